"""Names of columns in German, French, Chinese and Japanese logs, as English words.

A name is taken apart into known words and nothing else: `Lageistwert`, `实际位置`, `トルク指令`.
"""

import unicodedata
from functools import cache

# English words -> how they are called elsewhere; an empty line's words say nothing of the role.
_WORDS = {
    "time": "zeit temps 时间 時間 时刻 時刻",
    "timestamp": "zeitstempel horodatage 时间戳 タイムスタンプ",
    "position": "position lage weg 位置",
    "angle": "winkel 角度",
    "encoder": "geber",
    "displacement": "verschiebung deplacement 位移 変位",
    "velocity": "geschwindigkeit drehzahl vitesse 速度 转速 轉速 回転速度 回転数 角速度",
    "force": "kraft effort 力 推力",
    "torque": "drehmoment couple 力矩 转矩 轉矩 扭矩 トルク",
    "moment": "moment",
    "current": "strom courant 电流 電流",
    "temperature": "temperatur 温度",
    "actual": "ist istwert mesure mesuree reel reelle 实际 實際 实测 反馈 当前 "
    "実 実際 実測 現在 測定 フィードバック",
    "setpoint": "soll sollwert vorgabe consigne 指令 命令 目标 目標 设定 設定 给定 期望 参考",
    "motor": "motor antrieb antriebs moteur 电机 電機 モータ モーター",
    "axis": "achse axe 轴 軸",
    "joint": "gelenk 关节 関節",
    "": "wert s valeur 值 値",
}
_ENGLISH = {word: english for english, words in _WORDS.items() for word in words.split()}
# "consigne de position"
PARTICLES = frozenset({"de", "du"})
_LONGEST = max(map(len, _ENGLISH))


def plain(text: str) -> str:
    """Letters without accents, full-width signs as usual ones; kana keep their marks."""
    if text.isascii():
        return text
    if any(unicodedata.east_asian_width(c) in "FH" for c in text):
        text = unicodedata.normalize("NFKC", text)
    return "".join(_bare(c) for c in text)


def _bare(character: str) -> str:
    base = unicodedata.normalize("NFD", character)[0]
    return base if base.isascii() and base.isalpha() else character


def english(word: str) -> list[str]:
    """The English words that a word, in small letters, stands for; itself where it is not known."""
    found = _apart(word)
    return [word] if found is None else [each for each in found if each]


@cache
def _apart(word: str) -> tuple[str, ...] | None:
    """A word as known ones, the longest first, or `None`; what alone says nothing is not known."""
    if word in _ENGLISH:
        return (_ENGLISH[word],) if _ENGLISH[word] else None
    for length in range(min(len(word) - 1, _LONGEST), 0, -1):
        head = word[:length]
        if head in _ENGLISH:
            rest = word[length:]
            tail = ("",) if _ENGLISH.get(rest) == "" else _apart(rest)
            if tail is not None:
                return (_ENGLISH[head], *tail)
    return None

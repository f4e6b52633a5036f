"""Examples of each command, below its `--help`."""

_LINES = {
    "demo": ["jaxfric demo --out demo"],
    "identify": [
        "jaxfric identify axis.csv",
        "jaxfric identify axis.csv --model best --save model.json --plot friction.png",
        "jaxfric identify log.mat --columns time=t,position=qm,force=vir --scale force=35.15",
        "jaxfric identify encoder.csv --counts-per-rev 8192",
        "jaxfric identify trace.csv --rate 1000 --units force=A,position=rad",
    ],
    "explain": [
        "jaxfric explain axis.csv --holdout other.csv --report page.html --save better.json",
        "jaxfric explain axis.csv --baseline model.json --fixed   # which of its values are wrong",
        "jaxfric explain today.csv --baseline january.csv         # what changed in this machine",
        "jaxfric explain log.csv --mujoco arm.xml --joint elbow",
        "jaxfric explain log.csv --columns known_force=tau_sim    # your own simulator's force",
    ],
    "predict": ["jaxfric predict model.json axis.csv -o predicted.csv"],
    "simulate": [
        "jaxfric simulate model.json reference.csv --controller pd:kp=5000,kd=300 -o run.csv",
        "jaxfric simulate explained.json reference.csv --compensate drive.json -o run.csv",
    ],
    "export": [
        "jaxfric export model.json --to c -o axis.c",
        "jaxfric export model.json --to st --name x_axis -o x_axis.st",
        "jaxfric export model.json --to st -o axis.st --reference cycle.csv  # what it is worth",
        "jaxfric export model.json --to fmu -o axis.fmu",
        "jaxfric export model.json --to mujoco --speed 0:0.2",
    ],
    "models": ["jaxfric models"],
    "presliding": [
        "jaxfric presliding axis.csv --model lorentzian --save bristles.json",
        "jaxfric presliding axis.csv --model better.json   # with all that explain had found",
    ],
    "effects": [
        "jaxfric effects",
        "jaxfric effects cogging",
        "jaxfric effects --json effects.json",
    ],
    "fleet": [
        "jaxfric fleet 'logs/**/*.parquet' --out fits.parquet --plot fleet.png",
        "jaxfric fleet logs --model lorentzian --axis axis --out fits.csv",
    ],
    "select": ["jaxfric select axis.csv --json standings.json"],
    "watch": [
        "jaxfric watch growing.csv --keep 600",
        "logger | jaxfric watch - --window 20 --every 60",
        "jaxfric watch axis.csv --once --json",
    ],
    "design": [
        "jaxfric design model.json --position 0.1 --velocity 0.12 --acceleration 3 --jerk 300 "
        "-o motion.csv",
    ],
    "prove": ["jaxfric prove --cases 24 --jobs 2 --out proof"],
}
EXAMPLES = {name: "\n  ".join(["examples:", *lines]) for name, lines in _LINES.items()}

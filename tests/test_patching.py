"""A simulator's file put right: only what was meant is changed, and MuJoCo reads it back."""

import difflib
import json
import math
from argparse import Namespace

import numpy as np
import pytest

from jaxfric import models, terms
from jaxfric.cli import main
from jaxfric.cli.joint_columns import logged
from jaxfric.cli.robot_joints import _scales
from jaxfric.data.joints import columns_of
from jaxfric.data.tables import load
from jaxfric.export.callback import callback
from jaxfric.export.held import kept
from jaxfric.simulators import Mujoco
from jaxfric.simulators.actuation import passive
from jaxfric.simulators.patching import patched

mujoco = pytest.importorskip("mujoco")

ARM = """<mujoco model="arm">
  <!-- kept as it is: 2 > 1 -->
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" damping="0.8"
             armature='0.05'/>
      <geom fromto="0 0 0 0.3 0 0" type="capsule" size="0.03" mass="2.0"/>
      <frame>
        <body name="forearm" pos="0.3 0 0">
          <joint name="elbow" axis="0 1 0" damping="0.5"/>
          <inertial pos="0.1 0 0" mass="1.2" diaginertia="0.01 0.01 0.001"/>
        </body>
      </frame>
    </body>
  </worldbody>
  <actuator><motor name="m" joint="elbow" gear="5 0 0 0 0 0"/></actuator>
</mujoco>
"""


def changed(values, text=ARM):
    done = patched(mujoco, text, values)
    lines = difflib.unified_diff(text.splitlines(), done.text.splitlines(), lineterm="", n=0)
    return done, [line[1:].strip() for line in list(lines)[2:] if line[0] == "+"]


def test_one_attribute_is_one_attribute():
    done, lines = changed({"joint/shoulder/armature": 0.07})
    assert done.written == ("joint/shoulder/armature",) and not done.left
    assert lines == ['armature="0.07"/>']
    done, lines = changed({"joint/elbow/frictionloss": 0.3})
    assert lines == ['<joint name="elbow" axis="0 1 0" damping="0.5" frictionloss="0.3"/>']
    assert changed({})[0].text == ARM


def test_a_mass_takes_its_inertia_along():
    done, lines = changed({"body/forearm/mass": 1.8})
    assert lines == ['<inertial pos="0.1 0 0" mass="1.8" diaginertia="0.015 0.015 0.0015"/>']
    done, lines = changed({"body/upper/mass": 2.5})
    assert lines == ['<geom fromto="0 0 0 0.3 0 0" type="capsule" size="0.03" mass="2.5"/>']
    done, lines = changed({"body/upper/centre_x": 0.2})
    assert len(lines) == 1 and lines[0].startswith('<inertial mass="2" pos="0.2 0 0"')
    model = mujoco.MjModel.from_xml_string(done.text)
    np.testing.assert_allclose(model.body_ipos[1], [0.2, 0, 0])


def test_a_spring_is_written_in_the_files_own_unit():
    values = {"joint/elbow/stiffness": 3.0, "joint/elbow/springref": 0.4}
    done, lines = changed(values)
    assert f'springref="{math.degrees(0.4):.7g}"' in lines[0]
    model = mujoco.MjModel.from_xml_string(done.text)
    assert model.qpos_spring[1] == pytest.approx(0.4) and model.jnt_stiffness[1] == 3.0
    radian = ARM.replace("<worldbody>", '<compiler angle="radian"/><worldbody>', 1)
    assert 'springref="0.4"' in changed(values, radian)[1][0]


def test_a_gear_keeps_its_other_numbers_and_what_is_none_is_left():
    done, lines = changed({"actuator/m/gear": 4.5, "joint/elbow/damping": -0.1})
    assert 'gear="4.5 0 0 0 0 0"' in lines[0] and done.written == ("actuator/m/gear",)
    assert "below zero" in done.left["joint/elbow/damping"]


def test_what_another_file_holds_is_left(tmp_path):
    (tmp_path / "body.xml").write_text(
        '<mujocoinclude><body name="b"><joint name="j"/><geom size=".1"/></body></mujocoinclude>'
    )
    whole = tmp_path / "robot.xml"
    whole.write_text(
        '<mujoco><worldbody><include file="body.xml"/></worldbody></mujoco>', encoding="utf-8"
    )
    done = patched(mujoco, whole, {"joint/j/damping": 1.0})
    assert done.written == () and "include" in done.left["joint/j/damping"]
    assert done.text == whole.read_text()


def test_a_urdf_becomes_a_model_of_mujoco(tmp_path):
    inertia = '<inertia ixx=".01" iyy=".02" izz=".02" ixy="0" ixz="0" iyz="0"/>'
    link = f'<link name="l"><inertial><origin xyz=".1 0 0"/><mass value="1"/>{inertia}</inertial>'
    joint = '<joint name="j" type="continuous"><parent link="b"/><child link="l"/>'
    path = tmp_path / "arm.urdf"
    path.write_text(
        f'<robot name="r"><link name="b"/>{link}</link>{joint}<axis xyz="0 1 0"/></joint></robot>'
    )
    done = patched(mujoco, path, {"joint/j/stiffness": 2.0, "body/l/mass": 1.5})
    model = mujoco.MjModel.from_xml_string(done.text)
    assert model.jnt_stiffness[0] == 2.0 and model.body_mass[1] == 1.5 and not done.left
    # Without friction a heavier link is as a force that is read too large.
    assert [str(each) for each in Mujoco(path).attributes()["gain"].alike] == ["mass of body l"]


def test_the_callback_takes_the_terms_force_off_the_joint():
    units = {"force": "N·m", "position": "rad"}
    cogging = models.from_parameters(
        terms.Cogging(), {"cogging_sin": 0.3, "cogging_cos": -0.1, "pitch": 0.5}, units
    )
    text = callback({"elbow": cogging}, {"elbow": 2.0}, "arm_forces.py")
    space: dict = {}
    exec(compile(text, "arm_forces.py", "exec"), space)
    x = np.linspace(-1, 1, 7)
    expected = 0.3 * np.sin(4 * np.pi * x) - 0.1 * np.cos(4 * np.pi * x)
    found = [space["FORCES"]["elbow"](value, 1.0, 0.0) for value in x]
    np.testing.assert_allclose(found, expected, atol=1e-12)
    model = mujoco.MjModel.from_xml_string(ARM)
    data = mujoco.MjData(model)
    data.qpos[1] = 0.07
    space["install"](mujoco)
    try:
        mujoco.mj_forward(model, data)
    finally:
        mujoco.set_mjcb_passive(None)
    assert data.qfrc_passive[1] == pytest.approx(-space["FORCES"]["elbow"](0.07, 0.0, 0.0))
    assert 'from_xml_path("arm.xml")' in text


# ---- whose a column is ----


@pytest.mark.parametrize(
    "names",
    [
        ["shoulder_position", "elbow_position", "shoulder_effort", "elbow_effort"],
        ["shoulder/pos", "elbow/pos", "shoulder/tau", "elbow/tau"],
        ["/joint_states/shoulder/position", "/joint_states/elbow/position",
         "/joint_states/shoulder/effort", "/joint_states/elbow/effort"],
        ["q1", "q2", "tau1", "tau2"],
        ["q:1", "q:2", "tau:1", "tau:2"],
        ["q[0]", "q[1]", "current[0]", "current[1]"],
        ["q_shoulder [rad]", "q_elbow [rad]", "torque_shoulder [Nm]", "torque_elbow [Nm]"],
    ],
)  # fmt: skip
def test_columns_of_joints_by_name_and_by_number(names):
    found = columns_of(["time", *names, "elbow_position_cmd"], ["shoulder", "elbow"], {}, "log")
    pairs = zip(names[:2], names[2:], strict=True)
    expected = [{"position": position, "force": force} for position, force in pairs]
    assert [found["shoulder"], found["elbow"]] == expected


def test_columns_of_joints_that_are_said():
    names = ["t", "q1", "q2", "tau1", "tau2"]
    found = columns_of(names, ["shoulder", "elbow"], {"shoulder": "q2", "elbow": "q1"}, "log")
    assert found["shoulder"] == {"position": "q2", "force": "tau2"}
    with pytest.raises(ValueError, match=r"no column 'q9' for shoulder"):
        columns_of(names, ["shoulder", "elbow"], {"shoulder": "q9"}, "log")
    with pytest.raises(ValueError, match=r"elbow_force=elbow_effort"):
        columns_of(["elbow_pos", "elbow_effort", "elbow_torque"], ["elbow"], {}, "log")


def test_the_force_of_a_position_that_is_said_is_the_column_beside_it():
    names = ["t", "hip_position", "hip_torque", "link2_position", "link2_torque"]
    found = columns_of(names, ["hip", "knee"], {"knee": "link2_position"}, "log")
    assert found["knee"] == {"position": "link2_position", "force": "link2_torque"}


TWO = """<mujoco><worldbody><body name="upper"><joint name="hip" axis="0 1 0"/>
<geom size="0.1" mass="1"/><body name="fore" pos="0.3 0 0"><joint name="knee" axis="0 1 0"
 ref="20"/><geom size="0.05" mass="0.5"/></body></body></worldbody></mujoco>"""


def named(tmp_path, header, held="", columns=(), save=None, joint=None):
    """What is said of files with these columns."""
    paths = []
    for number, names in enumerate(filter(None, (header, held))):
        paths.append(tmp_path / f"log{number}.csv")
        rows = np.random.default_rng(number).normal(size=(20, len(names.split(","))))
        np.savetxt(paths[-1], rows, delimiter=",", header=names, comments="")
    files = [str(path) for path in paths] + [None]
    return Namespace(file=files[0], holdout=files[1], columns=dict(columns), save=save, joint=joint)


WHOLE = "time,hip_position,hip_torque,knee_position,knee_torque"


def test_a_joint_s_own_factor_goes_before_that_of_all_positions():
    given = {"position": 2.0, "elbow_position": 3.0, "elbow_force": 5.0, "time": 0.1}
    joints = ["shoulder", "elbow"]
    own = {"time": 0.1, "position": 3.0, "shoulder": 2.0, "reference": 3.0, "force": 5.0}
    assert _scales(given, joints, "elbow", True) == own
    assert _scales(given, joints, "shoulder") == {"time": 0.1, "position": 2.0, "elbow": 3.0}
    assert _scales({"knee_position": 3.0}, joints, "elbow") == {"knee_position": 3.0}


def test_a_joint_without_a_force_is_told_and_one_that_no_log_knows_stands(tmp_path):
    found = logged(named(tmp_path, "time,hip_position,hip_torque,knee_position"), ["hip", "knee"])
    assert found.chosen == ["hip"] and found.still == []
    assert "log0.csv: there is no force of the joint knee" in found.without["knee"]
    log = named(tmp_path, "time,hip_position,hip_torque,knee_position")
    found = logged(log, ["hip", "knee"], {"knee"})
    assert "No actuator of the model drives the joint knee" in found.without["knee"]
    found = logged(named(tmp_path, "time,hip_position,hip_torque"), ["hip", "knee"])
    assert found.chosen == ["hip"] and found.still == ["knee"] and not found.without
    # A position that is no joint's may be its, and a force is of a joint that moves.
    for more in ("link_position", "knee_torque"):
        found = logged(named(tmp_path, f"time,hip_position,hip_torque,{more}"), ["hip", "knee"])
        assert found.still == []


@pytest.mark.parametrize(
    "actuators, undriven",
    [
        ('<motor joint="cart"/>', {"pole"}),
        ('<motor joint="cart"/><position jointinparent="pole"/>', set()),
        ('<motor joint="cart"/><motor site="tip"/>', set()),  # which may drive any joint
        ("", set()),
    ],
)
def test_a_joint_that_no_actuator_drives_is_passive(actuators, undriven):
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><joint name="cart" type="slide" axis="1 0 0"/><geom size="1"/>'
        '<body><joint name="pole"/><geom size="1"/><site name="tip"/></body></body></worldbody>'
        f"<actuator>{actuators}</actuator></mujoco>"
    )
    assert passive(mujoco, model, ["cart", "pole"]) == undriven


def test_a_name_that_is_no_joint_and_a_file_without_joints_are_refused(tmp_path):
    given = {"knie_force": "knee_torque"}
    with pytest.raises(ValueError, match=r"--columns knie_force=knee_torque: there is no joint"):
        logged(named(tmp_path, WHOLE, columns=given), ["hip", "knee"])
    logged(named(tmp_path, WHOLE, columns={"time": "time", "hip_effort": "hip_torque"}), ["hip"])
    with pytest.raises(ValueError, match=r"log1.csv: no joint of the model has a position"):
        logged(named(tmp_path, WHOLE, "time,a_position,a_torque"), ["hip", "knee"])


def test_a_file_that_cannot_be_written_is_refused_at_once(tmp_path, capsys):
    xml = tmp_path / "two.xml"
    xml.write_text(TWO)
    path = named(tmp_path, WHOLE).file
    for save, what in (("x.urdf", "--save x.xml"), ("x.json", "several joints are no one model")):
        options = ["--mujoco", str(xml), "--save", save]
        assert main(["explain", path, *options]) == 2
        assert what in capsys.readouterr().err


def test_what_makes_the_held_out_recording_worse_is_not_written():
    """Of a wrong and a right change the right one; none where each is worse than nothing."""
    effects = {"right": -0.5, "wrong": 0.2, "worse": 0.9}

    def error(some):
        return np.exp(sum(effects[name] for name in some))

    assert kept(["right", "worse"], error) == ["right"]
    assert kept(["right", "wrong"], error) == ["right", "wrong"]  # together no worse than before
    assert kept(["worse", "wrong"], error) == []


# ---- forms in which robots are logged ----


def joint_arrays(count=50):
    time = 0.01 * np.arange(count)
    return time, np.stack([np.sin(time), np.cos(time)], 1), np.stack([time, 2 * time], 1)


def test_arrays_of_all_joints_have_their_names(tmp_path):
    time, q, tau = joint_arrays()
    path = tmp_path / "log.npz"
    np.savez(path, t=time, q=q, tau=tau, joint_names=np.array(["shoulder", "elbow"]))
    table = load(path)
    assert set(table.columns) == {"t", "shoulder/q", "elbow/q", "shoulder/tau", "elbow/tau"}
    np.testing.assert_array_equal(table.columns["elbow/tau"], tau[:, 1])
    np.savez(path, t=time, q=q, tau=tau)
    found = columns_of(load(path).columns, ["shoulder", "elbow"], {}, "log")
    assert found["elbow"] == {"position": "q:2", "force": "tau:2"}


def test_vectors_in_a_row_are_joints(tmp_path):
    """As LeRobot writes them, with the joints' names in the data set's description and without."""
    pa = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    time, q, tau = joint_arrays()
    columns = {
        "observation.state": pa.array(q.astype(np.float32).tolist(), pa.list_(pa.float32(), 2)),
        "observation.effort": tau.tolist(), "action": (q + 0.1).tolist(),
        "timestamp": time.astype(np.float32), "episode_index": np.zeros(len(time), int),
        "observation.images": [["a"]] * len(time),
    }  # fmt: skip
    path = tmp_path / "data" / "chunk-000" / "episode_000000.parquet"
    path.parent.mkdir(parents=True)
    parquet.write_table(pa.table(columns), path)
    found = columns_of(load(path).columns, ["shoulder", "elbow"], {}, "log")
    assert found["elbow"] == {"position": "position:2", "force": "effort:2"}
    (tmp_path / "meta").mkdir()
    parts = ["shoulder.pos", "elbow.pos"]
    features = {
        "observation.state": {"names": parts}, "action": {"names": {"motors": parts}},
        "observation.effort": {"names": ["shoulder", "elbow"]},
    }  # fmt: skip
    (tmp_path / "meta" / "info.json").write_text(json.dumps({"features": features}))
    table = load(path)
    assert {"elbow/position", "elbow/reference", "elbow/effort", "segment"} <= set(table.columns)
    np.testing.assert_allclose(table.columns["elbow/position"], q[:, 1], atol=1e-7)
    found = columns_of(table.columns, ["shoulder", "elbow"], {}, "log")
    assert found["elbow"] == {"position": "elbow/position", "force": "elbow/effort"}


@pytest.mark.parametrize("kind", ["SQLITE3", "MCAP"])
def test_joint_states_of_a_bag(tmp_path, kind):
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    store, (time, q, tau) = get_typestore(Stores.ROS2_HUMBLE), joint_arrays()
    header, stamp, state = (
        store.types[name]
        for name in (
            "std_msgs/msg/Header",
            "builtin_interfaces/msg/Time",
            "sensor_msgs/msg/JointState",
        )
    )
    path = tmp_path / "bag"
    plugin = getattr(rosbag2.StoragePlugin, kind)
    with rosbag2.Writer(path, version=9, storage_plugin=plugin) as writer:
        topic = writer.add_connection("/joint_states", state.__msgtype__, typestore=store)
        for i in range(len(time)):
            at = 10**18 + round(time[i] * 1e9)
            own = header(stamp(at // 10**9, at % 10**9), "")
            message = state(own, ["shoulder", "elbow"], q[i], np.zeros(0), tau[i])
            writer.write(topic, at + 5, store.serialize_cdr(message, state.__msgtype__))
    table = load(path)
    np.testing.assert_allclose(table.columns["time"], time, atol=1e-9)
    np.testing.assert_array_equal(table.columns["elbow/effort"], tau[:, 1])
    assert "elbow/velocity" not in table.columns
    found = columns_of(table.columns, ["shoulder", "elbow"], {}, "bag")
    assert found["shoulder"] == {"position": "shoulder/position", "force": "shoulder/effort"}


def test_without_its_reader_a_bag_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "rosbags", None)
    (tmp_path / "log.mcap").write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(ValueError, match=r"jaxfric\[ros\]"):
        load(tmp_path / "log.mcap")


def test_a_damaged_bag_is_refused(tmp_path):
    pytest.importorskip("rosbags")
    (tmp_path / "log.mcap").write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(ValueError, match="no readable bag"):
        load(tmp_path / "log.mcap")


def test_a_role_may_have_any_of_its_names():
    given = {"shoulder_pan_effort": "current", "shoulder_pan_pos": "position"}
    found = columns_of(["time", "position", "current"], ["shoulder_pan"], given, "log.csv")
    assert found == {"shoulder_pan": {"position": "position", "force": "current"}}

"""URDFs as people have them: several last links, mimicking joints, meshes in packages, what xacro
leaves behind.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from vsconstraints import Robot, RobotPoint
from vsconstraints.constraints import link_bodies
from vsconstraints.constraints.bodies import mesh
from vsconstraints.errors import ConfigurationError
from vsconstraints.robots.urdf import link_geometry
from vsconstraints.scenarios import Scenario

LIMIT = '<limit lower="-1" upper="2" velocity="3" effort="1"/>'

TETRAHEDRON = """solid tetrahedron
{}
endsolid tetrahedron
"""
CORNERS = ((0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.0, 0.25, 0.0), (0.0, 0.0, 0.125))


def joint(
    name: str,
    parent: str,
    child: str,
    kind: str = "revolute",
    inside: str = LIMIT,
    axis: str = "0 0 1",
) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 1"/><axis xyz="{axis}"/>{inside}</joint>'
    )


def mimic(leader: str, factor: float, offset: float) -> str:
    return f'{LIMIT}<mimic joint="{leader}" multiplier="{factor}" offset="{offset}"/>'


def written(path: Path, links: str, *joints: str, head: str = 'name="own"', more: str = "") -> Path:
    bodies = "".join(f'<link name="{name}"/>' for name in links.split())
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        f'<?xml version="1.0"?><!-- made by hand --><robot '
        f"{head}>{bodies}{''.join(joints)}{more}</robot>"
    )
    return path


def gripper_arm(folder: Path) -> Path:
    return written(
        folder / "arm.urdf",
        "base a hand left right base_mark",
        joint("mark", "base", "base_mark", "fixed", ""),
        joint("j1", "base", "a"),
        joint("j2", "a", "hand", axis="0 1 0"),
        joint("grip", "hand", "left", "prismatic", axis="1 0 0"),
        joint("grip 2", "hand", "right", "prismatic", mimic("grip", -2.0, 0.05), axis="1 0 0"),
    )


# --- tips ---


def test_several_links_that_may_be_the_tip_are_named_and_none_is_taken(tmp_path: Path) -> None:
    path = gripper_arm(tmp_path)
    with pytest.raises(ConfigurationError) as error:
        Robot.from_urdf(path)
    assert (
        "arm.urdf has several links that may be the tip: left, right; they branch off 'hand'"
        in str(error.value)
    )
    assert Robot.from_urdf(path, "hand").joint_names == ("j1", "j2")


def test_locked_fingers_leave_the_choice_open(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="left, right"):
        Robot.from_urdf(gripper_arm(tmp_path), locked={"grip": 0.0, "grip 2": 0.0})


def test_the_only_last_link_that_moves_is_the_tip_wherever_it_stands_in_the_file(
    tmp_path: Path,
) -> None:
    path = written(
        tmp_path / "arm.urdf",
        "tool base a zero",
        joint("mark", "base", "zero", "fixed", ""),
        joint("j1", "base", "a"),
        joint("flange", "a", "tool", "fixed", ""),
    )
    arm = Robot.from_urdf(path)
    np.testing.assert_allclose(arm.pose([0.0]).t, [0.0, 0.0, 2.0])


@pytest.mark.parametrize(
    ("link", "name", "kind", "refused"),
    [
        ("jaw", "j2", "revolute", True),
        ("tool", "left_Finger_joint", "prismatic", True),
        ("gripper_base", "j2", "fixed", False),
        ("tool", "j2", "revolute", False),
    ],
)
def test_a_finger_is_no_tip_unless_it_is_named(
    tmp_path: Path, link: str, name: str, kind: str, refused: bool
) -> None:
    joints = joint("j1", "base", "hand"), joint(name, "hand", link, kind)
    path = written(tmp_path / "arm.urdf", f"base hand {link}", *joints)
    if refused:
        with pytest.raises(
            ConfigurationError, match=rf"'{link}', seems to be a part of a gripper.*tip = \"hand\""
        ):
            Robot.from_urdf(path)
    else:
        assert Robot.from_urdf(path).joint_names[0] == "j1"
    assert Robot.from_urdf(path, link).pose(np.zeros(1 + (kind != "fixed"))).t[2] == 2.0
    assert Robot.from_urdf(path, "hand").n == 1


# --- joints that mimic others ---


def test_a_locked_joint_that_mimics_stands_where_the_other_one_puts_it(tmp_path: Path) -> None:
    path = gripper_arm(tmp_path)
    at_rest = np.zeros(2)

    def right(locked: dict[str, float]) -> float:
        points = [RobotPoint("right")]
        return float(
            Robot.from_urdf(path, "hand", locked=locked)
            .kinematics(at_rest, at_rest, points)
            .points[0, 0]
        )

    assert right({}) == pytest.approx(0.05)
    assert right({"grip": 0.1}) == pytest.approx(-2.0 * 0.1 + 0.05)
    assert right({"grip": 0.1, "grip 2": 0.3}) == pytest.approx(0.3)


def test_joints_may_mimic_one_that_mimics(tmp_path: Path) -> None:
    path = written(
        tmp_path / "arm.urdf",
        "base hand f1 f2",
        joint("j1", "base", "hand"),
        joint("third", "f1", "f2", "prismatic", mimic("second", 3.0, 0.01), axis="1 0 0"),
        joint("second", "hand", "f1", "prismatic", mimic("j1", 1.0, 0.2), axis="1 0 0"),
    )
    found = Robot.from_urdf(path, "hand").kinematics(np.zeros(1), np.zeros(1), [RobotPoint("f2")])
    assert found.points[0, 0] == pytest.approx(0.2 + 3.0 * 0.2 + 0.01)


@pytest.mark.parametrize("tip", ["hand", "left"])
def test_a_joint_that_mimics_none_that_is_there_is_refused_unless_it_is_locked(
    tmp_path: Path, tip: str
) -> None:
    finger = joint("grip", "hand", "left", "prismatic", mimic("nobody", 2.0, 0.3), axis="1 0 0")
    path = written(tmp_path / "arm.urdf", "base hand left", joint("j1", "base", "hand"), finger)
    with pytest.raises(
        ConfigurationError, match=r"'grip' .* mimics 'nobody', and there is no such"
    ):
        Robot.from_urdf(path, tip)
    robot = Robot.from_urdf(path, tip, locked={"grip": 0.2})
    found = robot.kinematics(np.zeros(1), np.zeros(1), [RobotPoint("left")])
    assert found.points[0, 0] == pytest.approx(0.2)


def test_a_joint_may_mimic_a_fixed_one(tmp_path: Path) -> None:
    mount = joint("mount", "base", "plate", "fixed")
    arm = joint("j1", "plate", "hand")
    finger = joint("grip", "hand", "left", "prismatic", mimic("mount", 2.0, 0.3), axis="1 0 0")
    path = written(tmp_path / "arm.urdf", "base plate hand left", mount, arm, finger)
    assert Robot.from_urdf(path, "hand").n == 1


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        (mimic("grip 2", 1.0, 0.0), mimic("grip", 1.0, 0.0), ["'grip'", "mimics it", "lock"]),
        (mimic("j1", np.nan, 0.0), LIMIT, ["'grip'", "finite"]),
        (LIMIT + '<mimic joint="j1" multiplier="two"/>', LIMIT, ["'grip'", "'two'"]),
    ],
)
def test_mimics_that_make_no_sense_are_refused(
    tmp_path: Path, first: str, second: str, words: list[str]
) -> None:
    path = written(
        tmp_path / "arm.urdf",
        "base hand left right",
        joint("j1", "base", "hand"),
        joint("grip", "hand", "left", inside=first),
        joint("grip 2", "hand", "right", inside=second),
    )
    with pytest.raises(ConfigurationError) as error:
        Robot.from_urdf(path, "hand")
    assert all(word in str(error.value) for word in words), str(error.value)


# --- xacro and what stands beside the arm ---

BESIDE = """
<ros2_control name="arm" type="system"><hardware><plugin>x</plugin><param name="ip">$(optenv IP)</param></hardware>
  <joint name="j1"><command_interface name="position"/></joint>
  <joint name="j2" mimic="true"><param name="mimic">j1</param><mimic joint="j1"/></joint></ros2_control>
<transmission name="t1"><joint name="j1"/><actuator name="m1"/></transmission>
<gazebo reference="a"><material>Gazebo/Grey</material></gazebo>
"""


def test_what_xacro_drivers_and_simulators_leave_in_a_file_is_no_part_of_the_arm(
    tmp_path: Path,
) -> None:
    head = 'name="own" xmlns="http://www.ros.org" xmlns:xacro="http://www.ros.org/wiki/xacro"'
    joints = [joint("j1", "base", "a"), joint("j2", "a", "b", "continuous", "", axis="0 1 0")]
    plain = Robot.from_urdf(written(tmp_path / "plain.urdf", "base a b", *joints))
    full = Robot.from_urdf(
        written(tmp_path / "full.urdf", "base a b", *joints, head=head, more=BESIDE)
    )
    assert full.joint_names == plain.joint_names == ("j1", "j2")
    np.testing.assert_array_equal(full.q_max, [2.0, np.inf])
    q = np.array([0.4, 7.0])
    np.testing.assert_array_equal(full.pose(q).R, plain.pose(q).R)
    # no masses are needed to move
    assert full.model.nq == full.model.nv == 2


@pytest.mark.parametrize(
    ("name", "head", "more"),
    [
        ("arm.urdf.xacro", 'name="own"', ""),
        ("arm.xacro", 'name="own"', ""),
        ("arm.urdf", 'name="own" xmlns:xacro="http://www.ros.org/wiki/xacro"', "<xacro:hand/>"),
        ("arm.urdf", 'name="own"', '<link name="${prefix}tool"/>'),
        (
            "arm.urdf",
            'name="own"',
            '<link name="c"><visual><mesh filename="$(find own)/c.stl"/></visual></link>',
        ),
    ],
)
def test_a_file_that_xacro_has_not_been_through_is_told_the_command(
    tmp_path: Path, name: str, head: str, more: str
) -> None:
    path = written(tmp_path / name, "base a", joint("j1", "base", "a"), head=head, more=more)
    with pytest.raises(ConfigurationError) as error:
        Robot.from_urdf(path)
    made = "expanded-arm.urdf" if name == "arm.urdf" else "arm.urdf"
    assert f"xacro {path} -o {tmp_path / made}" in str(error.value)
    # xacro as pip installs it fails at $(find …), xacrodoc does not
    assert f"pip install xacrodoc, then xacrodoc {path} -d FOLDER -o {tmp_path / made}" in str(
        error.value
    )


# --- what is wrong with a file is named ---

TWO_JOINTS = joint("j2", "base", "b", "fixed", "") + joint("j3", "b", "a", "fixed", "")


@pytest.mark.parametrize(
    ("links", "joints", "head", "words"),
    [
        (
            "base a",
            joint("j1", "base", "a", axis="0 0 0"),
            None,
            "joint 'j1' .* axis '0 0 0' has no direction",
        ),
        (
            "base a",
            joint("j1", "base", "a", "prismatic", axis="0 0 -0"),
            None,
            "joint 'j1' .* has no direction",
        ),
        (
            "base a",
            joint("j1", "base", "a", axis="0 1"),
            None,
            r'joint \'j1\' .*<axis xyz="0 1"> must be 3 finite numb',
        ),
        (
            "base a",
            joint("j1", "base", "a", axis="0, 0, 1"),
            None,
            "3 finite numbers; decimals are written with a poi",
        ),
        (
            "base a",
            joint("j1", "base", "a", axis="0 0 nan"),
            None,
            r'<axis xyz="0 0 nan"> must be 3 finite numbers$',
        ),
        (
            "base a b",
            joint("j1", "base", "a") + TWO_JOINTS,
            None,
            "link 'a' .* child of two joints, 'j1' and 'j3'",
        ),
        ("base a b", joint("j1", "a", "b") + joint("j2", "b", "a"), None, "circle: a → b → a"),
        ("base a", joint("j1", "a", "a"), None, "joint 'j1' .* connects the link 'a' to itself"),
        ("base a b", joint("j1", "base", "a"), None, "2 links without a parent: base, b"),
        ("base a", joint("j1", "base", "a"), "", r'the robot has no name; .*<robot name="…">'),
        (
            "base a",
            joint("j1", "base", "a", "revolut"),
            None,
            "type of the joint 'j1' .*Did you mean 'revolute'",
        ),
        (
            "base a",
            joint("j1", "base", "a").replace(' type="revolute"', ""),
            None,
            "joint 'j1' .*has no type; it is one",
        ),
        (
            "base a",
            joint("j1", "base", "a").replace('name="j1" ', ""),
            None,
            "joint number 1 has no name",
        ),
        (
            "base a",
            joint("j1", "base", "a").replace(' lower="-1"', ' lower="-1,5"'),
            None,
            'lower="-1,5"> must be a fini',
        ),
        (
            "base a",
            joint("j1", "base", "a").replace('xyz="0 0 1"', 'xyz="0,5 0 1"'),
            None,
            'origin xyz="0,5 0 1"> must',
        ),
        (
            "base a",
            joint("j1", "base", "a").replace('velocity="3', 'velocity="-3'),
            None,
            'velocity="-3", which is neg',
        ),
        (
            "base a",
            joint("j1", "base", "elbow"),
            None,
            "unknown child link of the joint 'j1' .*'elbow'.*base",
        ),
        (
            "base a",
            '<joint name="j1" type="fixed"><child link="a"/></joint>',
            None,
            "joint 'j1' .* has no parent",
        ),
        ("base a a", joint("j1", "base", "a"), None, "two links of the name 'a'"),
        (
            "base a b",
            joint("j1", "base", "a") + joint("j1", "base", "b"),
            None,
            "two joints of the name 'j1'",
        ),
    ],
)
def test_what_is_wrong_with_a_urdf_is_named(
    tmp_path: Path, links: str, joints: str, head: str | None, words: str
) -> None:
    path = written(
        tmp_path / "arm.urdf", links, joints, head='name="own"' if head is None else head
    )
    with pytest.raises(ConfigurationError, match=words) as error:
        Robot.from_urdf(path, "a")
    assert "arm.urdf" in str(error.value)


@pytest.mark.parametrize(
    ("part", "words"),
    [
        (
            '<inertial><mass value="1,5"/></inertial>',
            r'link \'c\' .*<mass value="1,5"> must be a finite number; decimals',
        ),
        (
            '<collision><geometry><box size="1 1"/></geometry></collision>',
            r'<box size="1 1"> must be 3 finite numbers$',
        ),
    ],
)
def test_masses_and_solids_that_the_parser_would_leave_out_are_named(
    tmp_path: Path, part: str, words: str
) -> None:
    link = f'<link name="c">{part}</link>'
    path = written(
        tmp_path / "arm.urdf", "base a", link, joint("j1", "base", "a"), joint("j2", "a", "c")
    )
    with pytest.raises(ConfigurationError, match=words):
        Robot.from_urdf(path)


def test_a_fixed_joint_needs_no_axis_and_an_axis_no_length(tmp_path: Path) -> None:
    """Exporters write zeros for the axis of fixed joints."""
    fixed = joint("j2", "a", "tool", "fixed", "", axis="0 0 0")
    path = written(
        tmp_path / "arm.urdf", "base a tool", joint("j1", "base", "a", axis="0 0 1e-3"), fixed
    )
    R = Robot.from_urdf(path).pose([0.3]).R
    np.testing.assert_allclose(R, Robot.from_dh([[0.0, 0.0, 0.0, 0.0]]).pose([0.3]).R, atol=1e-12)


# --- meshes ---


def tetrahedron(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    faces = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
    text = "\n".join(
        "facet normal 0 0 0\nouter loop\n"
        + "\n".join("vertex {} {} {}".format(*CORNERS[i]) for i in face)
        + "\nendloop\nendfacet"
        for face in faces
    )
    path.write_text(TETRAHEDRON.format(text))


COLLADA = """<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><created>2020-01-01T00:00:00</created><modified>2020-01-01T00:00:00</modified>{asset}</asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="12">{numbers}</float_array><technique_common>
<accessor source="#pa" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/>
<p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>
"""


def collada(path: Path, asset: str) -> Path:
    numbers = " ".join(str(number) for corner in CORNERS for number in corner)
    path.write_text(COLLADA.format(asset=asset, numbers=numbers))
    return path


def mesh_arm(path: Path, name: str) -> Path:
    solid = (
        f'<link name="a"><collision><geometry><mesh '
        f'filename="{name}"/></geometry></collision></link>'
    )
    return written(path, "base", solid, joint("j1", "base", "a"))


def corners(robot: Robot) -> set[tuple[float, ...]]:
    (body,) = link_bodies(robot)
    ((_, solid),) = body.parts
    return {tuple(point.tolist()) for point in np.asarray(solid.points())}


@pytest.mark.parametrize(
    ("name", "mesh", "given", "variable", "value"),
    [
        ("meshes/a.stl", "robots/meshes/a.stl", None, "", ""),
        ("../meshes/a.stl", "meshes/a.stl", None, "", ""),
        ("package://own_arm/meshes/a.stl", "own_arm/meshes/a.stl", None, "", ""),
        ("package:///own_arm/meshes/a.stl", "own_arm/meshes/a.stl", None, "", ""),
        ("package://own_arm/meshes/a.stl", "elsewhere/own_arm/meshes/a.stl", "elsewhere", "", ""),
        (
            "package://own_arm/meshes/a.stl",
            "elsewhere/own_arm/meshes/a.stl",
            "elsewhere/own_arm",
            "",
            "",
        ),
        ("model://own_arm/meshes/a.stl", "elsewhere/own_arm/meshes/a.stl", "elsewhere", "", ""),
        (
            "package://own_arm/a.stl",
            "opt/share/own_arm/a.stl",
            None,
            "AMENT_PREFIX_PATH",
            "nowhere:opt",
        ),
        ("package://own_arm/a.stl", "src/own_arm/a.stl", None, "ROS_PACKAGE_PATH", "src"),
        ("package://own_arm/a.stl", "src/stack/own_arm/a.stl", None, "ROS_PACKAGE_PATH", "src"),
        (
            "package://own_arm/a.stl",
            "src/own_arm/a.stl",
            None,
            "ROS_PACKAGE_PATH",
            "nowhere:src/own_arm",
        ),
        ("package://own_arm/a.stl", "src/own_arm/a.stl", "src/none", "ROS_PACKAGE_PATH", "src"),
        ("file://", "some where/a.stl", None, "", ""),
    ],
)
def test_meshes_are_found_where_people_have_them(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    mesh: str,
    given: str | None,
    variable: str,
    value: str,
) -> None:
    for one in ("AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH"):
        monkeypatch.delenv(one, raising=False)
    tetrahedron(tmp_path / mesh)
    package = (tmp_path / mesh).parent
    if package.name == "own_arm":
        (package / "package.xml").write_text("<package/>")
    path = mesh_arm(
        tmp_path / "robots" / "arm.urdf", f"file://{tmp_path / mesh}" if name == "file://" else name
    )
    package_dirs = None if given is None else [tmp_path / given]
    if variable:
        with pytest.raises(ConfigurationError):
            link_bodies(Robot.from_urdf(path, package_dirs=package_dirs))
        monkeypatch.setenv(
            variable, os.pathsep.join(str(tmp_path / one) for one in value.split(":"))
        )
    assert corners(Robot.from_urdf(path, package_dirs=package_dirs)) == set(CORNERS)


def test_a_scenario_says_where_packages_are_and_keeps_their_meshes_among_its_files(
    tmp_path: Path,
) -> None:
    tetrahedron(tmp_path / "packages" / "own_arm" / "a.stl")
    mesh_arm(tmp_path / "robots" / "arm.urdf", "package://own_arm/a.stl")
    (tmp_path / "own.toml").write_text(
        'robot = { urdf = "robots/arm.urdf", package_dirs = ["packages"] }\nq0 = [0.1]\n'
        "sampling_time = 0.01\nduration = 0.1\n"
        "camera = { focal_px = [400, 400], size_px = [640, 480] }\n"
        "target = { square = { side = 0.1, xyz = [0, 0, 2] } }\n"
        'task = { feature = "camera-pose", Kp0 = 1, goals = [{ camera_at_q = [0.2] }] }\n'
    )
    scenario = Scenario.load(tmp_path / "own.toml")
    assert corners(scenario.setup().scene.robot) == set(CORNERS)
    assert tmp_path / "packages/own_arm/a.stl" in scenario.files
    elsewhere = scenario.with_override("robot.package_dirs", ["elsewhere"], tmp_path / "robots")
    assert elsewhere.tables["robot"]["package_dirs"] == [str(tmp_path / "robots" / "elsewhere")]
    with pytest.raises(ConfigurationError, match=r"robot: package_dirs must be a list of strings"):
        scenario.with_override("robot.package_dirs", [1]).setup()


@pytest.mark.parametrize("up_axis", ["", "<up_axis>Y_UP</up_axis>", "<up_axis>Z_UP</up_axis>"])
@pytest.mark.parametrize(
    ("asset", "metres"),
    [
        ("", 1.0),
        ('<unit name="meter" meter="1"/>', 1.0),
        ("<unit/>", 1.0),
        ('<unit name="inch" meter="0.0254"/>', 0.0254),
        ('<unit name="millimeter" meter="1.0e-3"/>', 0.001),
    ],
)
def test_the_unit_of_a_collada_file_is_applied_once_wherever_its_mesh_is_used(
    tmp_path: Path, asset: str, up_axis: str, metres: float
) -> None:
    """As RViz does, which ignores the axis: the expected corners are those of the file in
    metres.
    """
    file = collada(tmp_path / "a.dae", asset + up_axis)
    part = '<{0}><geometry><mesh filename="a.dae" scale="{1}"/></geometry></{0}>'
    link = (
        f'<link name="a">{part.format("collision", "1 1 1")}{part.format("visual", "2 2 2")}</link>'
    )
    arm = Robot.from_urdf(written(tmp_path / "arm.urdf", "base", link, joint("j1", "base", "a")))
    expected = np.array(CORNERS) * metres
    found = {
        "collision constraints": np.array(sorted(corners(arm))),
        "pictures": np.array(sorted({tuple(p) for p in _drawn(arm)})) / 2.0,
        "an obstacle": np.array(
            sorted({tuple(p) for p in np.asarray(mesh(file, (3.0, 3.0, 3.0)).points())})
        )
        / 3.0,
    }
    for use, points in found.items():
        np.testing.assert_allclose(
            points, sorted(expected.tolist()), rtol=1e-6, atol=1e-9, err_msg=use
        )


def _drawn(arm: Robot) -> list[list[float]]:
    assert arm.source is not None
    (drawn,) = link_geometry(arm.source, "visual").geometryObjects
    listed: list[list[float]] = np.asarray(drawn.geometry.vertices()).tolist()
    return listed


@pytest.mark.parametrize("unit", ["0", "-1", "inch", "inf", "nan"])
def test_a_unit_that_is_no_length_is_refused(tmp_path: Path, unit: str) -> None:
    file = collada(tmp_path / "a.dae", f'<unit meter="{unit}"/>')
    with pytest.raises(
        ConfigurationError, match=rf"a\.dae: <unit meter=.*positive number of metres.*'{unit}'"
    ):
        link_bodies(Robot.from_urdf(mesh_arm(tmp_path / "arm.urdf", "a.dae")))
    with pytest.raises(ConfigurationError, match="positive number of metres"):
        mesh(file)


def test_a_collada_file_that_is_no_xml_is_named_where_it_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.dae").write_text("<COLLADA><asset>")
    with pytest.raises(ConfigurationError, match=r"arm\.urdf cannot be read"):
        link_bodies(Robot.from_urdf(mesh_arm(tmp_path / "arm.urdf", "a.dae")))


def test_a_mesh_that_is_not_there_is_named_with_what_can_be_done(tmp_path: Path) -> None:
    arm = Robot.from_urdf(
        mesh_arm(tmp_path / "arm.urdf", "package://own_arm/a.stl"), package_dirs=[tmp_path]
    )
    with pytest.raises(ConfigurationError) as error:
        link_bodies(arm)
    for word in (
        "'a'",
        "package://own_arm/a.stl",
        str(tmp_path),
        "package_dirs",
        "ROS_PACKAGE_PATH",
        "link_radius",
    ):
        assert word in str(error.value)
    with pytest.raises(ConfigurationError, match=r"https://own/a\.stl"):
        link_bodies(Robot.from_urdf(mesh_arm(tmp_path / "arm.urdf", "https://own/a.stl")))
    (tmp_path / "a.stl").write_text("no mesh")
    with pytest.raises(ConfigurationError, match=r"arm\.urdf cannot be read"):
        link_bodies(Robot.from_urdf(mesh_arm(tmp_path / "arm.urdf", "a.stl")))
    # kinematics need no mesh, capsules neither
    assert arm.pose([0.0]).t[2] == 1.0
    assert link_bodies(arm, 0.05) == ()

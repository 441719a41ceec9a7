"""Models that would crash, hang or mislead: each is refused in one line, before it takes time or memory."""

import resource
import time
import warnings

import mujoco
import numpy as np
import pytest

from project import ROOT
from rmrc import arm as arms
from rmrc.arm import numbers
from rmrc.arm.bounds import bounded_memory
from rmrc.plants.servo import rate_servo
from rmrc.support.errors import ModelError, ModelWarning
from wording import says


def model(head="", world="", joint="", inertial="", upper='pos="0 0 1"', tip="tip", tail="", geom=""):
    """Return an arm of two links as MJCF, with something odd about it."""
    return f"""<mujoco>{head}<worldbody>{world}
<body name="lower"><joint name="shoulder" axis="0 1 0" {joint}/>{inertial}<geom type="capsule" size="0.05 0.5" {geom}/>
<body name="upper" {upper}><joint name="elbow" axis="0 1 0"/><geom type="capsule" size="0.05 0.5"/>
<site name="{tip}" pos="0 0 1"/></body></body></worldbody>{tail}</mujoco>"""


def refusal(tmp_path, text):
    """Return what is said about a model, without its path."""
    path = tmp_path / "model.xml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ModelError) as caught:
        arms.load(path)
    message = str(caught.value)
    assert "\n" not in message and message.startswith(f"{path}:")
    return message.removeprefix(f"{path}:").strip()


NOT_FINITE = {
    "inertial": (
        model(inertial='<inertial pos="0.5 nan 0" mass="1" diaginertia="1 1 1"/>'),
        '2: inertial of body "lower": pos … finite … "0.5 nan 0"',
    ),
    "keyframe": (
        model(tail='<keyframe><key name="home" qpos="0 NaN"/></keyframe>'),
        '4: key "home": qpos … finite … "0 NaN"',
    ),
    "stiffness": (model(joint='stiffness="nan"'), '2: joint "shoulder": stiffness … finite … "nan"'),
    "range": (model(joint='range="-inf inf"'), '2: joint "shoulder": range … finite … "-inf inf"'),
    "mass": (model(geom='mass="nan"'), '2: geom of body "lower": mass … finite … "nan"'),
    "gravity": (
        model(head='<option gravity="0 0 -Infinity"/>'),
        '1: option: gravity … finite … "0 0 -Infinity"',
    ),
    "gain": (
        model(tail='<actuator><velocity name="servo" joint="elbow" kv="-nan"/></actuator>'),
        '4: velocity "servo": kv … finite … "-nan"',
    ),
    "entity": (
        model(joint='damping="n&#97;n"'),
        '2: joint "shoulder": damping … finite … "nan"',
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", NOT_FINITE)
def test_a_number_that_is_none_is_named_with_line_element_and_attribute(tmp_path, capfd, case):
    text, message = NOT_FINITE[case]
    assert refusal(tmp_path, text) == says(f"{message}; …")
    assert capfd.readouterr().err == ""  # MuJoCo prints of a NaN by itself


def test_an_included_file_is_looked_at_too(tmp_path):
    (tmp_path / "gains.xml").write_text("<mujoco>\n<option timestep='nan'/></mujoco>")
    path = tmp_path / "model.xml"
    path.write_text(model(head='<include file="gains.xml"/>'))
    with pytest.raises(ModelError) as caught:
        arms.load(path)
    assert str(caught.value) == says(f'{tmp_path}/gains.xml:2: option: timestep … finite … "nan"; …')


def test_words_that_look_like_no_number_are_words(tmp_path):
    path = tmp_path / "model.xml"
    texts = '<custom><text name="inf" data="nan"/></custom><!-- <joint range="nan"/> -->'
    path.write_text(model(tip="nan", tail=texts))
    assert arms.load(path).site == "nan"


FIELDS = {  # field of the compiled model, row -> the element and the attribute as the author knows them
    ("body_ipos", 2): 'body "upper": inertial pos',
    ("body_mass", 1): 'body "lower": mass of its inertial or geoms',
    ("jnt_stiffness", 1): 'joint "elbow": stiffness',
    ("dof_damping", 1): 'joint "elbow": damping',
    ("dof_armature", 0): 'joint "shoulder": armature',
    ("qpos0", 1): 'joint "elbow": ref',
    ("key_qpos", 0): 'key "home": qpos',
    ("geom_friction", 1): 'geom 1 of body "upper": friction',
    ("site_pos", 0): 'site "tip": pos',
    ("actuator_gainprm", 0): 'actuator "servo": gainprm (kp, kv)',
    ("numeric_data", 3): 'numeric "more": data',
    ("eq_data", 0): "equality 0: data (anchor, relpose, polycoef)",
    ("sensor_noise", 0): "sensor 0: noise",
    ("opt.timestep", 0): "option timestep",
    ("opt.wind", 0): "option wind",
    ("vis.map.zfar", 0): "visual map zfar",
    ("vis.headlight.ambient", 0): "visual headlight ambient",
    ("stat.extent", 0): "statistic extent",
}
FULL = model(
    tail="""<keyframe><key name="home"/></keyframe><actuator><velocity name="servo" joint="elbow" kv="1"/></actuator>
<custom><numeric name="some" data="1 2 3"/><numeric name="more" data="4 5"/></custom>
<sensor><jointpos joint="elbow"/></sensor><equality><joint joint1="elbow" joint2="shoulder"/></equality>"""
)


def test_a_direction_that_mujoco_cannot_scale_is_refused_and_what_it_says_of_it_is_not_passed_on(tmp_path):
    text = model(joint="").replace('axis="0 1 0"', 'axis="1e300 0 1e300"', 1)
    assert refusal(tmp_path, text) == says('joint "shoulder": axis … 1 … 0 0 0; … 1')


def test_an_actuator_that_moves_nothing_limits_nothing(tmp_path):
    actuators = """<actuator><velocity joint="elbow" gear="5e-324" ctrlrange="-1 1" forcerange="-1 1"/>
<motor joint="shoulder" gear="0" ctrlrange="-1 1"/><motor joint="shoulder" gear="2" ctrlrange="-3 3"/></actuator>"""
    path = tmp_path / "model.xml"
    path.write_text(model(tail=actuators))
    arm = arms.load(path)
    assert arm.rate_limit.tolist() == [np.inf, np.inf]
    assert arm.torque_limit.tolist() == [6.0, np.inf]


@pytest.mark.filterwarnings("default")  # MuJoCo warns of such a model
def test_an_arm_that_feels_no_inertia_cannot_be_held(rmrc, tmp_path):
    (tmp_path / "model.xml").write_text(model(joint='armature="-1000"'))
    code, out, err = rmrc("statics", "model.xml", "--wrench", "1,2,3", "--hold", "0.3")
    assert (code, out) == (2, "")
    assert err.splitlines()[1:] == [
        says('rmrc: error: … hold: joint "shoulder" … inertia … 0 … home … -990.021; …')
    ]


def test_an_arm_that_diverges_while_it_holds_is_one_line(rmrc, tmp_path):
    # a spring that is stretched by 1e29 rad turns the shoulder out of all numbers at once
    (tmp_path / "model.xml").write_text(model(joint='springref="1e29" stiffness="1e29"'))
    code, _, err = rmrc("statics", "model.xml", "--wrench", "1,2,3", "--hold", "0.3")
    assert code == 3
    assert err.startswith("rmrc: error: diverged at tick 1 ") and err.count("\n") == 1


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e31])
@pytest.mark.parametrize("field", FIELDS)
def test_each_float_of_a_compiled_model_is_looked_at(field, value):
    """As arithmetic of the compiler may make one of numbers that are finite."""
    name, row = field
    compiled = mujoco.MjModel.from_xml_string(FULL)
    numbers.check(ROOT, compiled)
    *path, last = name.split(".")
    holder = compiled
    for step in path:
        holder = getattr(holder, step)
    if isinstance(getattr(holder, last), float):
        setattr(holder, last, value)
    else:
        getattr(holder, last)[row] = value
    if name.startswith("stat.") and np.isfinite(value):  # computed: it may be large
        numbers.check(ROOT, compiled)
        return
    with pytest.raises(ModelError) as caught:
        numbers.check(ROOT, compiled)
    most = 1e6 if name.endswith(("pos", "qpos0")) else 1e30
    bound = f"±{most:g}" if np.isfinite(value) else "finite"
    assert str(caught.value) == says(f"{ROOT}: {FIELDS[field]} … {bound} …")


def test_every_array_of_floats_has_its_turn():
    """A generic check must not lose fields: each array of MuJoCo's that has numbers is spoiled once."""
    compiled = mujoco.MjModel.from_xml_string(FULL)
    names = [
        name
        for name in dir(compiled)
        if isinstance(values := getattr(compiled, name), np.ndarray)
        and values.dtype.kind == "f"
        and values.size
    ]
    assert len(names) > 70
    for name in names:
        values = getattr(compiled, name)
        before = values.flat[-1]
        values.flat[-1] = np.nan
        with pytest.raises(ModelError):
            numbers.check(ROOT, compiled)
        values.flat[-1] = before
    numbers.check(ROOT, compiled)


NAMES = {
    "escape": (model(tip="t&#27;[31mip"), '… name of site 0 … control character … U+001B … "t\\x1b[31mip"; …'),
    "newline": (model(tip="t&#10;ip"), '… name of site 0 … control character … U+000A … "t\\nip"; …'),
    "backwards": (
        model(tail='<keyframe><key name="a\u202eb"/></keyframe>'),
        '… name of key 0 … control character … U+202E … "a\\u202eb"; …',
    ),
    "line": (
        model(tail='<actuator><motor joint="elbow" name="a\u2028b"/></actuator>'),
        '… name of actuator 0 … control character … U+2028 … "a\\u2028b"; …',
    ),
    "bytes": (model(tip="t\xff").encode("latin-1"), '… name of site 0 … UTF-8 … "t\\\\xff"; …'),
    "long": (
        model(tip="\t" + "t" * 10_000),
        '… name of site 0 … control character … U+0009 … "\\\\t' + "t" * 35 + '..."; …',
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", NAMES)
def test_a_name_with_a_control_character_is_refused_and_shown_harmlessly(tmp_path, case):
    text, message = NAMES[case]
    said = refusal(tmp_path, text)
    assert said == says(message.replace("\\\\t", "\\t")) and said.isprintable()


@pytest.mark.parametrize("name", ["🦾", "[red]tip[/red]", "Ellbogen ß", "t" * 10_000, "کتاب‌خانه"])
def test_other_names_are_names(tmp_path, name):
    path = tmp_path / "model.xml"
    path.write_text(model(tip=name), "utf-8")
    assert arms.load(path).site == name


BALL = '<geom size="1"/>'
HUGE = {
    "replicated": (model(world=f'<replicate count="1000000">{BALL}</replicate>'), "1: … 10000 elements … replicate … 1000003…"),
    "nested": (
        model(world='<replicate count="1000">' * 2 + BALL + "</replicate>" * 2),
        "1: … 10000 elements … replicate … 1001003…",
    ),
    "after": (
        model(world=f'<replicate count="9000">{BALL}</replicate>' + 999 * BALL),
        "1: … 10000 elements … replicate … 10001…",
    ),
    "joints": (
        model(world='<replicate count="3001"><body><freejoint/><geom size="1"/></body></replicate>'),
        "1: … 3000 joints …",
    ),
    "keys": (model(head='<size nkey="100000000"/>'), '1: size nkey="100000000" … 10000 …'),
    "texture": (
        model(head='<asset><texture name="t" type="2d" builtin="flat" width="100000" height="100000"/></asset>'),
        '1: texture width="100000" height="100000" … 67108864 … 10000000000',
    ),
    "textures": (
        model(head="<asset>" + 60 * '<texture type="2d" builtin="flat" width="8000" height="8000"/>' + "</asset>"),
        '1: texture width="8000" height="8000" … 67108864 … 128000000',
    ),
    "hfield": (
        model(head='<asset><hfield name="h" nrow="50000" ncol="50000" size="1 1 1 1"/></asset>'),
        '1: hfield nrow="50000" ncol="50000" … 16777216 …',
    ),
    "flex": (
        model(world='<flexcomp name="f" type="grid" count="1000 1000 1000" spacing="1 1 1" dim="3"/>'),
        '1: flexcomp count="1000 1000 1000" … 30000 …',
    ),
    "search": (
        model(head='<compiler><lengthrange inttotal="1e30"/></compiler>', tail='<actuator><muscle joint="elbow"/></actuator>'),
        "compiler lengthrange: inttotal / timestep … 100000 … 1e+30 / 0.01",
    ),
    "solver": (
        model(head='<option iterations="2000000000" tolerance="0"/>'),
        "option iterations … 10000 … 2000000000",
    ),
    "user": (model(head='<size nuserdata="10000001"/>'), "… 10000000 … nuserdata … 10000001"),
}  # fmt: skip


@pytest.mark.parametrize("case", HUGE)
def test_what_would_take_all_time_or_memory_is_refused_at_once(tmp_path, case):
    text, message = HUGE[case]
    before = time.process_time()
    assert refusal(tmp_path, text) == says(message)
    assert time.process_time() - before < 10.0  # the compiler would take minutes and more


MEMORY = ('<size memory="1000G"/>', '<size njmax="2000000000"/>', '<size nuser_body="1000000000"/>')


@pytest.mark.skipif(not hasattr(resource, "RLIMIT_AS"), reason="limits of memory")
@pytest.mark.parametrize("head", MEMORY)
def test_memory_that_no_arm_needs_is_refused_and_the_process_lives_on(tmp_path, head):
    limits = resource.getrlimit(resource.RLIMIT_AS)
    assert refusal(tmp_path, model(head=head)) == says("… 4 GiB of memory; …")
    assert resource.getrlimit(resource.RLIMIT_AS) == limits


def test_a_limit_of_the_users_own_is_never_raised():
    limits = resource.getrlimit(resource.RLIMIT_AS)
    own = 2**45  # more than anything here takes, and less than what is asked for
    resource.setrlimit(resource.RLIMIT_AS, (own, limits[1]))
    try:
        with bounded_memory(2**46):
            assert resource.getrlimit(resource.RLIMIT_AS)[0] == own
        assert resource.getrlimit(resource.RLIMIT_AS)[0] == own
    finally:
        resource.setrlimit(resource.RLIMIT_AS, limits)


@pytest.mark.parametrize("text", ["<a '", "<" * 100_000, '<a "' * 50_000, "<!--" * 50_000, "<a>" * 50_000])
def test_a_text_that_is_no_xml_is_read_in_one_go(tmp_path, text):
    before = time.process_time()
    refusal(tmp_path, text)
    assert time.process_time() - before < 10.0  # a search that starts again at each mark would take a minute


OLD = model(head='<compiler settotalmass="3"/>')


def test_a_warning_of_mujoco_is_a_warning_of_ours(tmp_path):
    path = tmp_path / "model.xml"
    path.write_text(OLD)
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        arms.load(path)
    (warning,) = heard
    assert warning.category is ModelWarning
    assert str(warning.message).startswith(f"{path}: compiler attribute 'settotalmass' is deprecated")


@pytest.mark.filterwarnings("default")
def test_the_command_line_shows_it_once_in_a_line_of_its_own(rmrc, tmp_path):
    (tmp_path / "model.xml").write_text(OLD)
    code, out, err = rmrc("inspect", "model.xml")
    assert (code, err.count("\n")) == (0, 1)
    assert err.startswith("rmrc: warning: model.xml: compiler attribute 'settotalmass' is deprecated")
    assert "shoulder" in out


def test_a_model_that_no_plant_can_be_made_of_is_one_line(monkeypatch):
    """Should MuJoCo refuse what the author's own model was compiled with."""
    arm = arms.load(ROOT / "models/planar_2link.xml")
    monkeypatch.setattr(
        mujoco.MjSpec, "compile", lambda _: (_ for _ in ()).throw(ValueError("Error:\nof MuJoCo"))
    )
    with pytest.raises(ModelError) as caught:
        arm.adapted(rate_servo, 0.001, True)
    assert str(caught.value) == f"{arm.path}: Error: of MuJoCo"


@pytest.mark.parametrize("named", ["arm.xml", "./folder/../arm.xml", "other.xml"])
def test_a_model_that_is_attached_to_itself_is_refused(tmp_path, named):
    # MuJoCo reads it again and again, until its process dies.
    (tmp_path / "folder").mkdir()
    (tmp_path / "other.xml").write_text('<mujoco><asset><model name="m" file="arm.xml"/></asset></mujoco>')
    place = "other.xml" if named == "other.xml" else "arm.xml"
    path = tmp_path / "arm.xml"
    path.write_text(f'<mujoco>\n<asset><model name="m" file="{named}"/></asset>\n</mujoco>')
    with pytest.raises(ModelError) as caught:
        arms.load(path)
    line, last = (1, "arm.xml") if named == "other.xml" else (2, named)
    assert str(caught.value) == (
        f'{tmp_path / place}:{line}: model must name another file than itself, got "{last}"'
    )


def test_a_model_may_be_attached_twice(tmp_path):
    (tmp_path / "hand.xml").write_text(
        '<mujoco><worldbody><body name="hand"><geom size="0.1"/></body></worldbody></mujoco>'
    )
    path = tmp_path / "arm.xml"
    path.write_text(
        '<mujoco><asset><model name="a" file="hand.xml"/><model name="b" file="hand.xml"/></asset><worldbody><body><joint name="turn"/>'
        '<geom size="1"/><site name="tip"/><attach model="a" body="hand" prefix="a"/><attach model="b" body="hand" prefix="b"/>'
        "</body></worldbody></mujoco>"
    )
    assert arms.load(path).site == "tip"


@pytest.mark.parametrize("element", ["joint", "geom"])
def test_a_class_that_c_takes_for_a_format_is_refused(tmp_path, element):
    # Of a class that is not there MuJoCo makes a message, and prints it as a format: %n aborts the process.
    assert refusal(tmp_path, model(**{element: 'class="%s%n"'})) == says(
        f'2: {element}… class … "%" … "%s%n"; …'
    )

"""What is typed: options of every verb, right and wrong, on shipped models and scenarios."""

from typer.main import get_command

from rmrc.cli import app
from rmrc.scenario.choices import PLANTS

from . import left, shipped
from .case import Case
from .scenarios import FAST, KEYS, SCALARS

COMMANDS = get_command(app).commands
VERBS = tuple(COMMANDS)
AXES = ("x", "y", "z", "rx", "ry", "rz")
FIGURES = (
    "joint_rate.peak",
    "position_error.rms",
    "sigma.min",
    "joint_rate.peak_joint",
    "none",
    "return.joint_change",
    "wall_time",
    "",
)
SET_KEYS = (
    "control.feedback", "control.inverse.method", "control.inverse.damping.maximum", "arm.start[0]", "arm.start[9]", "arm.start[-1]", "arm.start",
    "task.axes", "task.length", "target.path[0]", "target.path[0].line.by[1]", "target.path[99999999999]", "plant.kind", "plant.kv", "plant.payload",
    "control.limits.rate", "control.at_singularity", "name", "arm.model", "arm.site", "expect.joint_rate.peak.below", "sweep.vary.control.feedback",
    "sweep.samples", "arm.encoder.deviation", "arm.stretch.link_1", "control..feedback", "control.", ".", "", "[0]", "control[0]", "a[", "a]b", "a[x]", "\x1b[31m",
)  # fmt: skip


def generate(chance):
    """Return a case: a verb and its options."""
    verb = chance.weighted(_VERBS)
    argv, files = _VERB[verb](chance)
    if chance.odds(0.12):
        argv = _mangled(chance, argv)
    encoding = (
        chance.pick(("ascii", "latin-1", "cp1252", "utf-16", "cp037")) if chance.odds(0.06) else "utf-8"
    )
    columns = (
        chance.pick(("1", "0", "20", "40", "60", "200", "-5", "x", "100000")) if chance.odds(0.08) else "80"
    )
    return Case(tuple(_typed(one) for one in argv), files, encoding, columns)


def _typed(text):
    """Return a text as a kernel would hand it over: bytes without NUL, what is no UTF-8 as lone surrogates."""
    data = text.replace("\0", "").encode("utf-8", "surrogatepass")[:100_000]
    return data.decode("utf-8", "surrogateescape")


def _mangled(chance, argv):
    """Lose, repeat, move or change what is typed."""
    argv = list(argv)
    for _ in range(chance.between(1, 3)):
        if not argv:
            break
        at = chance.under(len(argv))
        match chance.under(8):
            case 0:
                del argv[at]
            case 1:
                argv.insert(at, argv[at])
            case 2:
                argv.append(argv.pop(at))
            case 3:
                argv[at] = chance.word()
            case 4:
                argv.insert(
                    at,
                    chance.pick(
                        (
                            "--",
                            "-",
                            "--help",
                            "-h",
                            "--version",
                            "-x",
                            "--nonsense",
                            "",
                            "--json",
                            "-q",
                            "--no-limits",
                            "--=",
                            "--out=",
                        )
                    ),
                )
            case 5:
                argv[at] = argv[at][: chance.under(len(argv[at]) + 1)]
            case 6:
                argv[at] = argv[at] + chance.word()
            case _:
                argv[at] = argv[at] + "\udcff" if chance.odds(0.5) else argv[at] * chance.pick((2, 100))
    # A viewer or a cluster must never start.
    argv = [one for one in argv if not one.startswith(("local:", "tcp:"))]
    return (
        ["schema", *argv[1:]]
        if argv[:1] == ["replay"] and any(one.endswith(".rrd") for one in argv)
        else argv
    )


def _model(chance):
    return chance.pick(list(shipped.models()))


def _model_path(chance, name):
    if chance.odds(0.95):
        return f"../models/{name}.xml"
    return chance.pick(
        (
            "../models",
            "../models/none.xml",
            "../models/puma56.xml",
            "/dev/null",
            "",
            ".",
            "../scenarios/null_space.yaml",
            f"../models/{chance.word()}",
            "\udcff.xml",
        )
    )


def _scenario(chance):
    return chance.pick(list(shipped.scenarios()))


def _scenario_path(chance, name):
    if chance.odds(0.95):
        return f"../scenarios/{name}.yaml"
    return chance.pick(
        (
            "../scenarios",
            "none.yaml",
            "../scenarios/null_spac.yaml",
            "/dev/null",
            "",
            ".",
            "-",
            "../models/puma560.xml",
            f"../scenarios/{chance.word()}",
        )
    )


def _numbers(chance, count):
    """Return a list of numbers, most often of the right length."""
    if chance.odds(0.15):
        count = chance.under(9)
    plain = chance.odds(0.6)
    text = ",".join(
        chance.pick(("0", "0.1", "-0.3", "0.5", "1", "30 deg", "-1.2")) if plain else chance.number()
        for _ in range(count)
    )
    return chance.pick(
        (
            text,
            text,
            text,
            text,
            f"[{text}]",
            f" {text} ",
            text.replace(",", " "),
            text.replace(",", ";"),
            text + ",",
            chance.word(),
        )
    )


def _count(chance):
    return chance.pick(
        (
            "0",
            "1",
            "2",
            "3",
            "-1",
            "x",
            "1.5",
            "nan",
            "99999999999999999999",
            "1e3",
            "",
            "\u0663",
            "0x2",
            "007",
            "+2",
            " 2",
        )
    )


def _axes(chance):
    rows = [row for row in AXES if chance.odds(0.5)]
    if chance.odds(0.2):
        rows.append(chance.pick((*AXES, "w", "", " x", "X", "\x1b[31m")))
    return ",".join(rows)


def _about_model(chance, name):
    """Return options that all questions about a model share."""
    joints, argv = shipped.joints(name), []
    if chance.odds(0.4):
        argv += ["--q", _numbers(chance, len(joints))]
    if chance.odds(0.15):
        argv += ["--keyframe", chance.pick(("home", "none", chance.word()))]
    if chance.odds(0.2):
        argv += ["--site", chance.pick((*shipped.sites(name), *shipped.sites(name), "none", chance.word()))]
    if chance.odds(0.2):
        argv += ["--length", chance.number() if chance.odds(0.6) else "0.5"]
    if chance.odds(0.3):
        argv += ["--json"]
    if chance.odds(0.05):
        argv += ["--body", chance.pick(("link_1", "world", "none", chance.word()))]
    if chance.odds(0.03):
        argv += ["--package", chance.pick(("a=.", "a=", "=.", "a", chance.word()))]
    return argv


def _out(chance):
    """Return where files go, and what is in the way there."""
    if chance.odds(0.85):
        return [], {}
    return chance.pick(
        (
            (["--out", "there"], {}), (["--out", "a/b/c"], {}), (["--out", "."], {}), (["--out", ""], {}), (["--out", "file"], {"here/file": b"x"}),
            (["--out", "file/below"], {"here/file": b"x"}), (["--out", "/dev/null"], {}), (["--out", "/dev/full"], {}), (["--out", "/proc/nothing"], {}),
            (["--out", "x" * 300], {}), (["--out", "\udcff"], {}), (["--out", "\x1b[31m"], {}), (["--out", "[red]"], {}), (["--out", "a\nb"], {}),
        )
    )  # fmt: skip


def _picture(chance):
    name = chance.pick(
        (
            "a.png",
            "a.svg",
            "a.pdf",
            "a.jpg",
            "a",
            "",
            ".png",
            "none/a.png",
            "dir.png",
            "\x1b.png",
            "/dev/full.png",
        )
    )
    return ["--picture", name], {"here/dir.png/": b""}


def _check(chance):
    name = _model(chance)
    argv = ["check", _model_path(chance, name)]
    if chance.odds(0.3):
        argv += ["--site", chance.pick((*shipped.sites(name), "none", chance.word()))]
    if chance.odds(0.3):
        argv += ["--joints", chance.pick((",".join(shipped.joints(name)), "", ",", chance.word()))]
    if chance.odds(0.3):
        argv += ["--seed", chance.pick(("0", "7", "-1", "1e3", "x", "9" * 40))]
    return [*argv, *chance.pick(([], ["--json"], ["--jso"]))], {}


def _new(chance):
    name = _model(chance)
    argv = ["new", _model_path(chance, name)]
    if chance.odds(0.3):
        argv += ["--site", chance.pick((*shipped.sites(name), "none", chance.word()))]
    if chance.odds(0.3):
        argv += ["--joints", chance.pick((",".join(shipped.joints(name)), "", ",", chance.word()))]
    if chance.odds(0.2):
        argv += ["--length", chance.pick(("0.5", "0", "-1", "nan", "1e300", chance.number()))]
    if chance.odds(0.3):
        argv += ["--plant", chance.pick((*PLANTS.names, "", chance.word()))]
    argv += chance.pick(
        ([], ["-o", "-"], ["-o", "a.yaml"], ["-o", "dir"], ["-o", "none/a.yaml"], ["-o", "\x1b.yaml"])
    )
    return [*argv, *chance.pick(([], ["--force"], ["--json"], ["-q"]))], {"here/dir/": b""}


def _inspect(chance):
    name = _model(chance)
    argv = ["inspect", _model_path(chance, name), *_about_model(chance, name)]
    if chance.odds(0.2):
        argv += ["--axes", _axes(chance)]
    if chance.odds(0.2):
        argv += ["--task-frame", chance.pick(("world", "site", "base", "x", "", chance.word()))]
    if chance.odds(0.2):
        argv += ["--frame", chance.pick(("world", "site", "base", "x", "", chance.word()))]
    if chance.odds(0.2):
        argv += [
            "--joint-error",
            chance.pick(("0.1 deg", "0", "-1", chance.number(), _numbers(chance, len(shipped.joints(name))))),
        ]
    if chance.odds(0.2):
        argv += ["--wrench", _numbers(chance, chance.pick((3, 6)))]
    if chance.odds(0.02):
        more, files = _picture(chance)
        return argv + more, files
    return argv, {}


def _statics(chance):
    name = _model(chance)
    argv = [
        "statics",
        _model_path(chance, name),
        "--wrench",
        _numbers(chance, chance.pick((3, 6, 6))),
        *_about_model(chance, name),
    ]
    if chance.odds(0.2):
        argv += ["--task-frame", chance.pick(("world", "site", "base", "x", "", chance.word()))]
    if chance.odds(0.2):
        argv += ["--frame", chance.pick(("world", "site", "x", "", "SITE"))]
    if chance.odds(0.2):
        argv += ["--at", chance.pick((*shipped.sites(name), "none", chance.word()))]
    if chance.odds(0.2):
        argv += [chance.pick(("--gravity", "--no-gravity"))]
    if chance.odds(0.05):
        argv += ["--hold", chance.pick(("0.2", "0.2", "0.3", "0", "-1", "nan", "inf", "1e300", "x", ""))]
    return argv, {}


def _ik(chance):
    name = _model(chance)
    n = len(shipped.joints(name))
    argv = ["ik", _model_path(chance, name), *_about_model(chance, name)]
    goal = chance.under(5)
    if goal == 0:
        argv += ["--to-q", _numbers(chance, n)]
    elif goal < 4:
        argv += ["--to", _numbers(chance, chance.pick((2, 3, 3, 6)))]
    if chance.odds(0.15):
        argv += ["--quat", _numbers(chance, 4)]
    if chance.odds(0.3):
        argv += ["--axes", chance.pick(("x,y", "x,y,z", _axes(chance)))]
    if chance.odds(0.15):
        argv += ["--method", chance.pick(("damped", "newton", "newton", "x", ""))]
    if chance.odds(0.2):
        argv += [chance.pick(("--limits", "--no-limits"))]
    if chance.odds(0.06):
        argv += ["--all"]
    if chance.odds(0.15):
        argv += ["--iterates"]
    if chance.odds(0.2):
        argv += ["--tolerance", chance.pick(("1e-6", "1e-12", "1", "0", chance.number()))]
    return argv, {}


def _workspace(chance):
    name = _model(chance)
    argv = ["workspace", _model_path(chance, name), *_about_model(chance, name)]
    wrong = chance.odds(0.95)  # most of them: a map takes a second
    argv += ["--cells", _count(chance) if wrong else chance.pick(("10", "11"))]
    argv += ["--samples", _count(chance) if wrong and chance.odds(0.5) else "1000"]
    if chance.odds(0.3):
        argv += ["--plane", chance.pick(("xy", "xz", "yz", "rz", "zz", "", chance.word()))]
    if chance.odds(0.2):
        argv += ["--through", _numbers(chance, 3)]
    if chance.odds(0.3):
        argv += ["--map", chance.pick(("sigma_min", "manipulability", "condition", "postures", "x", ""))]
    if chance.odds(0.2):
        argv += ["--worst"]
    if chance.odds(0.3):
        joints = (*shipped.joints(name), "none", "", chance.word())
        argv += ["--over", ",".join(chance.pick(joints) for _ in range(chance.pick((1, 2, 2, 2, 3))))]
    more, files = _out(chance)
    return argv + more, files


def _sets(chance, most=3):
    argv = []
    for _ in range(chance.under(most + 1)):
        key = chance.pick(SET_KEYS) if chance.odds(0.6) else chance.pick(KEYS)
        value = chance.pick((chance.pick(SCALARS), chance.pick(SCALARS), chance.number(), chance.word()))
        argv += [
            "--set",
            chance.pick(
                (f"{key}={value}",) * 8 + (key, f"={value}", f"{key}=", f"{key} = {value}", f"{key}=={value}")
            ),
        ]
    return argv


def _run(chance):
    argv = ["run", _scenario_path(chance, _scenario(chance)), *FAST, *_sets(chance)]
    argv += chance.pick((["--no-record"],) * 12 + (["--record"], [])) + chance.pick(([], ["-q"], ["--quiet"]))
    more, files = _out(chance)
    if chance.odds(0.1):
        files = {
            **files,
            **chance.pick(
                (
                    {"here/recordings": b"x"},
                    {"here/recordings/null_space.npz/": b""},
                    {"here/recordings/puma560.workspace.png/": b""},
                )
            ),
        }
    return argv + more, files


def _vary(chance):
    argv = []
    for _ in range(chance.between(0, 2)):
        key = chance.pick(SET_KEYS)
        values = ",".join(
            chance.pick((chance.pick(SCALARS), chance.number(), "1", "2"))
            for _ in range(chance.between(1, 3))
        )
        argv += [
            "--vary",
            chance.pick(
                (f"{key}={values}",) * 6
                + (key, f"{key}=", f"={values}", f"{key}=[{values}]", f"{key}={values},,")
            ),
        ]
    return argv


def _compare(chance):
    argv = [
        "compare",
        _scenario_path(chance, _scenario(chance)),
        *FAST,
        *_vary(chance),
        *_sets(chance, 1),
        "--no-record",
    ]
    more, files = _out(chance)
    return argv + more, files


def _sweep(chance):
    argv = [
        "sweep",
        _scenario_path(chance, _scenario(chance)),
        *FAST,
        "--threads",
        "1" if chance.odds(0.9) else chance.pick(("0", "-1", "x", "")),
    ]
    argv += _vary(chance) if chance.odds(0.5) else []
    for _ in range(chance.under(3)):
        key, low, high = chance.pick(SET_KEYS), chance.number(), chance.number()
        argv += [
            chance.pick(("--random", "--sobol")),
            chance.pick(
                (f"{key}={low}..{high}",) * 5
                + ("control.feedback=1..2",) * 5
                + (f"{key}={low}", f"{key}=..", "x")
            ),
        ]
    argv += [
        "--samples",
        "2" if chance.odds(0.8) else chance.pick(("0", "-1", "x", "1.5", "99999999999999999999")),
    ]
    if chance.odds(0.2):
        argv += ["--repeat", chance.pick(("1", "2", "0", "-1", "x"))]
    if chance.odds(0.2):
        argv += ["--seed", chance.pick(("0", "1", "-1", "9223372036854775807", "99999999999999999999", "x"))]
    if chance.odds(0.15):
        argv += [
            "--record",
            chance.pick(
                (
                    "worst:1",
                    "best:1",
                    "worst",
                    "worst:0",
                    "worst:-1",
                    "worst:x",
                    "x:1",
                    "",
                    ":",
                    f"worst:1:{chance.pick(FIGURES)}",
                    f"best:{chance.word()}",
                )
            ),
        ]
    if chance.odds(0.05):
        argv += [
            "--cluster",
            chance.pick(
                (
                    "",
                    "x",
                    "local",
                    "local:",
                    "local:0",
                    "local:-1",
                    "local:x",
                    "tcp:",
                    "tcp://",
                    "http://x",
                    chance.word(),
                )
            ),
        ]
    argv += _sets(chance, 1)
    more, files = _out(chance)
    return argv + more, files


def _tune(chance):
    argv = ["tune", _scenario_path(chance, _scenario(chance)), *FAST, "--threads", "1"]
    wrong = chance.odds(0.9)  # most of them: a search takes a second
    argv += [
        "--runs",
        chance.pick(("0", "-1", "x", "1.5", "")) if wrong and chance.odds(0.7) else "2",
        "--perturbed",
        chance.pick(("0", "0", "1", "-1", "x")),
    ]
    if chance.odds(0.3) or wrong:
        argv += [
            "--only",
            chance.pick(
                (
                    "control.feedback=20",
                    "control.inverse.method=damped,x",
                    "control.feedback=nan",
                    "x=1",
                    "=",
                    "",
                    chance.word(),
                )
            ),
        ]
    for option in ("--delay", "--lag", "--noise", "--calibration"):
        if chance.odds(0.1):
            argv += [
                option,
                chance.pick(
                    ("8ms", "6ms..12ms", "0..1e-5", "-1", "2..1", "..", "nan", "1e400s", chance.number())
                ),
            ]
    argv += ["--ideal"] * chance.odds(0.2)
    for option in ("--start", "--offset", "--payload", "--slower", "--seed"):
        if chance.odds(0.15):
            argv += [option, chance.number()]
    if chance.odds(0.05):
        argv += ["--picture", chance.pick(("a.jpg", "", "a"))]
    more, files = _out(chance)
    return argv + _sets(chance, 1) + more, files


def _identify(chance):
    cells = ("0", "1.5", "nan", "", "-inf", "x", "1e308", "1e-308", chance.word())
    names = chance.pick(
        ("t,q,qdot_cmd",) * 4
        + ("t,q0,q1,qdot_cmd0,qdot_cmd1",) * 4
        + ("t,t,q", "q,qdot_cmd", "", chance.word())
    )
    width = names.count(",") + 1
    rows = [
        ",".join(
            f"{i * 0.01:.3f}"
            if j == 0 and chance.odds(0.99)
            else f"{(i % 17) * 0.1}"
            if chance.odds(0.95)
            else chance.pick(cells)
            for j in range(width)
        )
        for i in range(chance.pick((0, 1, 2, 40, 40, 200, 200, 200)))
    ]
    content = "\n".join([names, *rows]).encode("utf-8", "surrogatepass")
    name = chance.pick(("log.csv",) * 6 + ("log.txt", "log.npz", "log.parquet"))
    argv = ["identify", name]
    if chance.odds(0.3):
        argv += [
            "--columns",
            chance.pick(("t=t", "q=q*", "q=q,q1", "q=", "=", "", "x=t", "t=t ms", chance.word())),
        ]
    if chance.odds(0.2):
        argv += ["--longest", chance.number()]
    if chance.odds(0.2):
        argv += [chance.pick(("--degrees", "--json", "-q"))]
    more, files = _out(chance)
    return argv + more, {**files, f"here/{name}": content if chance.odds(0.95) else chance.noise(60)}


def _replay(chance):
    # Nothing of these is a recording: a viewer must not start.
    files = chance.pick(
        (
            {"here/a.rrd": b""},
            {"here/a.rrd": b"RR"},
            {"here/a.rrd": chance.noise(30)},
            {"here/a.rrd/": b""},
            {"here/a.rrd.part": b"PK"},
            {},
        )
    )
    name = chance.pick(
        ("a.rrd", "a.rrd.part", "a.rr", "", ".", "/dev/null", "../models/puma560.xml", chance.word())
    )
    return ["replay", name, *chance.pick(([], ["--web"], ["--web", "--web"], ["-x"]))], files


def _margins(chance):
    argv = ["margins", _scenario_path(chance, _scenario(chance)), *FAST, "--threads", "1"]
    wrong = chance.odds(0.8)  # most of them: a search takes a second
    accuracy = ("0", "-1", "nan", "inf", "x", "", "1e-9") if wrong else ("0.5",)
    argv += ["--accuracy", chance.pick(accuracy), *_sets(chance)]
    more = ([], ["--json"], ["--quiet"], ["--picture", "x.txt"], ["--picture", "x.png"])
    return argv + chance.pick(more), {}


def _of_left(chance, verb, suffixes):
    """Return a call of a verb that takes what others leave, and the files: sound, odd, damaged or missing."""
    files = {"here/a.npz": left.run(chance), "here/a.parquet": left.rows(chance)}
    if chance.odds(0.8):
        files["here/a.json"] = left.figures(chance)
    name = chance.pick(
        ("a.npz",) * 5 + ("a.parquet",) * 3 + ("a.json", "none.npz", ".", "/dev/null", chance.word())
    )
    out = chance.pick((*suffixes, *suffixes, "x.txt", "", ".", "file/x.png", "/dev/full"))
    argv = [verb, name, *(["-o", out] if chance.odds(0.8) else ["-o", suffixes[0]])]
    return argv, {**files, "here/file": b"x"}


def _plot(chance):
    argv, files = _of_left(chance, "plot", ("x.svg", "x.png", "x.pdf"))
    if chance.odds(0.4):
        argv += [
            "--panels",
            chance.pick(("rates", "path,g", "status", "parallel", "distributions", "", ",", "x")),
        ]
    if chance.odds(0.3):
        argv += ["--width", chance.pick(("3.5in", "88mm", "2in", "0in", "1e9in", "nan", "", chance.word()))]
    if chance.odds(0.2):
        argv += ["--font", chance.number()]
    return argv, files


def _report(chance):
    return _of_left(chance, "report", ("x.html", "x.htm"))


def _render(chance):
    argv, files = _of_left(chance, "render", ("x.png", "x.gif"))
    argv += ["--size", chance.pick(("64x64", "0x0", "1x", "x", "-1x64", "99999x99999", chance.word()))]
    if chance.odds(0.4):
        argv += [chance.pick(("--at", "--from", "--to", "--fps", "--speed")), chance.number()]
    return argv, files


def _schema(chance):
    return ["schema", *chance.pick(([], [], ["--json"], ["--jso"], ["x"], ["--help"], [chance.word()]))], {}


def _examples(chance):
    return ["examples", *chance.pick(([], ["--json"], ["--jso"], ["--help"], [chance.word()]))], {}


def _init(chance):
    folder = chance.pick(
        ("there", "a/b/c", ".", "", "file", "file/below", "/dev/null", "/proc/nothing", "x" * 300, "\x1b[31m", "\udcff", chance.word())
    )  # fmt: skip
    files = chance.pick(({}, {"here/file": b"x"}, {"here/there/models/": b""}))
    return ["init", *([] if chance.odds(0.05) else [folder]), *chance.pick(([], ["--help"], ["x"]))], files


def _declared(verb):
    """Return what makes options of a verb that has no function of its own: those that it declares."""
    options = [one for one in COMMANDS[verb].params if one.param_type_name == "option" and one.name != "help"]

    def make(chance):
        name = _model(chance)
        path = _model_path(chance, name) if chance.odds(0.3) else _scenario_path(chance, _scenario(chance))
        argv = [verb, path, *(FAST if any(one.name == "set_" for one in options) else ())]
        for one in options:
            if one.name not in ("set_", "out", "cluster", "threads") and chance.odds(0.25):
                argv += [
                    chance.pick(one.opts),
                    *([] if one.is_flag else [chance.pick((chance.number(), chance.word()))]),
                ]
        return argv, {}

    return make


def _root(chance):
    return chance.pick(
        (
            [],
            ["--help"],
            ["--version"],
            ["--versio"],
            ["-h"],
            [chance.word()],
            [chance.pick(VERBS)],
            [chance.pick(VERBS), "--help"],
            ["--", chance.pick(VERBS)],
        )
    ), {}


# What makes the options of each verb, and its share of them: of most, a small one.
_VERB = {verb: globals().get(f"_{verb}") or _declared(verb) for verb in (*VERBS, "root")}
_VERBS = dict.fromkeys(_VERB, 2) | {
    "check": 3, "run": 22, "compare": 3, "sweep": 10, "tune": 5, "replay": 5, "inspect": 15, "statics": 10, "ik": 16,
    "workspace": 5, "plot": 4, "report": 4, "render": 2,
}  # fmt: skip

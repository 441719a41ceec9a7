"""Who is let in: this machine by its own names, our own page, and elsewhere who knows the token."""

import gc
import http.client
import os
import random
import re
import shutil
import socket
import subprocess
from contextlib import closing
from types import SimpleNamespace

import pytest

pytest.importorskip("viser")

from websockets.datastructures import Headers
from websockets.http11 import Request
from websockets.sync.client import connect

from processes import wait_for
from rmrc.explore import rows, server
from rmrc.explore.answer import Explored
from rmrc.explore.gate import Gate
from rmrc.explore.server import ExploreError, Server
from wording import says

# As a server ends, it may still tell something; viser then warns, which `Server` ignores outside of tests.
pytestmark = pytest.mark.filterwarnings("ignore:Queued a")

SOCKET = {"Upgrade": "websocket"}


def asked(path="/", **headers):
    return Request(path, Headers({name.replace("_", "-"): value for name, value in headers.items()}))


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.1:8080", "localhost:81"])
def test_this_machine_is_let_in_by_its_own_names(host):
    gate = Gate(is_local=True)
    assert gate.path == "/"
    assert gate.admitted(asked(Host=host)).path == "/"
    assert gate.admitted(asked(Host=host, Origin=f"http://{host}", **SOCKET)) is not None


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "192.168.0.7:80", ""])
def test_a_page_of_another_name_that_leads_here_is_not(host):
    assert Gate(is_local=True).admitted(asked(Host=host)) is None
    assert Gate(is_local=True).admitted(asked()) is None


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "http://127.0.0.1:99", "null", "https://127.0.0.1:80"]
)
def test_a_socket_is_opened_by_our_own_page_alone(origin):
    gate = Gate(is_local=True)
    assert gate.admitted(asked(Host="127.0.0.1:80", Origin=origin, **SOCKET)) is None
    assert gate.admitted(asked(Host="127.0.0.1:80", **SOCKET)) is None


def test_from_elsewhere_only_who_knows_the_token():
    gate = Gate(is_local=False)
    host = {"Host": "10.0.0.2:80"}
    assert len(gate.token) >= 32  # 24 bytes
    assert gate.admitted(asked(gate.path, **host)).path == "/"
    assert gate.admitted(asked(f"{gate.path}x.js?y", **host)).path == "/x.js"
    own = {**host, "Origin": "http://10.0.0.2:80", **SOCKET}
    assert gate.admitted(asked(gate.path.rstrip("/"), **own)) is not None  # as viser's page asks for it
    for path in ("/", "/x", f"/{gate.token}x/", f"/{gate.token[:-1]}/", f"//{gate.token}/"):
        assert gate.admitted(asked(path, **host)) is None
    assert Gate(is_local=False).token != gate.token


@pytest.fixture
def served(scenario, tmp_path):
    one = scenario("target.path=[{line: {by: [0.02, 0.0]}}]")
    failures = []
    with Server(one, tmp_path, failed=failures.append) as found:
        found.failures, found.out, found.scenario = failures, tmp_path, one
        yield found


def port_of(served):
    return int(served.url.rstrip("/").rpartition(":")[2])


def test_the_page_comes_with_a_policy_that_keeps_it_at_home_and_has_no_foreign_links(served):
    with closing(http.client.HTTPConnection("127.0.0.1", port_of(served))) as line:
        line.request("GET", "/")
        answer = line.getresponse()
        policy, text = answer.headers["Content-Security-Policy"], answer.read().decode()
    assert answer.status == 200
    assert "default-src 'none'" in policy
    assert "http" not in policy
    assert "connect-src 'self'" in policy
    assert "<script" in text


@pytest.mark.parametrize(("name", "value"), [("Host", "evil.example"), ("Host", "10.0.0.2")])
def test_the_server_asks_its_gate(served, name, value):
    with closing(http.client.HTTPConnection("127.0.0.1", port_of(served))) as line:
        line.request("GET", "/", headers={name: value})
        assert line.getresponse().status == 403


def test_the_server_opens_no_socket_for_another_page(served):
    url = served.url.replace("http", "ws")
    for origin, is_in in (("http://evil.example", False), (served.url.rstrip("/"), True)):
        try:
            with connect(url, origin=origin, subprotocols=[f"viser-v{server_version()}"], open_timeout=30):
                opened = True
        except Exception:
            opened = False
        assert opened == is_in


def server_version():
    import viser

    return viser.__version__


def test_only_this_machine_is_listened_to(served):
    if not shutil.which("ss"):
        pytest.skip("no `ss` here")
    command = ["ss", "-ltnH", f"sport = :{port_of(served)}"]
    found = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert found
    assert {line.split()[3] for line in found.splitlines()} == {f"127.0.0.1:{port_of(served)}"}


def test_nobody_can_ask_for_a_public_address(served):
    from viser import _messages

    assert served._server.request_share_url() is None
    handlers = served._server._connection._incoming_handlers
    assert not {_messages.ShareUrlRequest, _messages.ShareUrlDisconnect} & set(handlers)


def test_a_port_in_use_is_told_in_one_line(scenario, tmp_path):
    with closing(socket.socket()) as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(ExploreError) as caught:
            Server(scenario(), tmp_path, port=port)
    assert str(caught.value) == says(f"127.0.0.1:{port} … in use; … --port …")


def test_an_address_of_another_machine_is_told_in_one_line(scenario, tmp_path):
    with pytest.raises(ExploreError, match=r"192\.0\.2\.1.*--host"):  # of no machine: RFC 5737
        Server(scenario(), tmp_path, host="192.0.2.1")


def test_a_missing_extra_is_told_with_the_command_for_it(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "viser", None)
    with pytest.raises(ExploreError, match=r"pip install 'rmrc\[explore\]'"):
        server.refuse_missing()


# Sessions, without a browser: what viser would make for one, its server has as well -----------------------------


class Scene:
    """A part of a scene, as each browser has one of its own."""

    def __init__(self, scene, number):
        self._scene, self._number = scene, number

    def __getattr__(self, name):
        function = getattr(self._scene, name)
        if not name.startswith("add_"):
            return function
        return lambda path, *given, **named: function(f"/{self._number}{path}", *given, **named)


def browser(served, number):
    """Return what a session asks of a browser."""
    whole = served._server
    camera = SimpleNamespace(image_width=1280, image_height=720, on_update=lambda _: None)
    return SimpleNamespace(
        gui=whole.gui,
        scene=Scene(whole.scene, number),
        atomic=whole.atomic,
        flush=whole.flush,
        camera=camera,
        client_id=number,
    )


def changed(session, key, value):
    """Move a control, as a reader does."""
    session._handles[key].value = value
    (control,) = (one for one in session.controls if one.key == key)
    session._change(control, SimpleNamespace(client=object()))


def test_a_session_answers_the_latest_change_as_rmrc_run_does(served):
    served._open(browser(served, 7))
    session = wait_for(lambda: served.sessions.get(7))
    wait_for(lambda: session.answer is not None)
    for value in (0.05, 0.07, 0.2):
        changed(session, "control.inverse.damping.maximum", value)
    wait_for(lambda: session.answer.values == {"control.inverse.damping.maximum": 0.2})
    alone = Explored(served.scenario).answer({"control.inverse.damping.maximum": 0.2}).run
    assert np_equal(session.answer.run, alone)
    assert np_equal(session._charts[0][1].data[0], alone["time"])
    changed(session, "control.inverse.damping.maximum", 0.1)  # as written
    wait_for(lambda: session.answer.values == {})
    session._ghost.value = "as written"  # which it is: nothing to draw beside it
    session._look(None)
    wait_for(lambda: not session._is_redrawn)
    assert session._other is None
    changed(session, "control.inverse.damping.maximum", 0.2)
    wait_for(lambda: session._other is not None)
    assert session._other.values == {}
    assert served.failures == []
    served._leave(SimpleNamespace(client_id=7))
    session._thread.join(30)
    assert not session._thread.is_alive()
    assert session.answer is None  # what it held is let go
    assert served.sessions == {}


def np_equal(one, other):
    if hasattr(one, "columns"):
        return all(one.columns[name].tobytes() == other.columns[name].tobytes() for name in other.columns)
    return one.tobytes() == other.tobytes()


def test_a_setting_that_cannot_be_leaves_what_is_shown(served):
    served._open(browser(served, 8))
    session = wait_for(lambda: served.sessions.get(8))
    wait_for(lambda: session.answer is not None)
    shown = session.answer
    with session._asking():
        session._values["control.feedback"] = -1.0
    wait_for(lambda: "ff2d2d" in session._said.content)
    assert session.answer is shown
    assert "control.feedback" in session._said.content
    assert served.failures == []


def test_a_session_that_fails_ends_alone(served, monkeypatch):
    for number in (1, 2):
        served._open(browser(served, number))
    first, second = (wait_for(lambda n=n: served.sessions.get(n)) for n in (1, 2))
    wait_for(lambda: first.answer is not None and second.answer is not None)
    monkeypatch.setattr(first, "_take", lambda _: 1 / 0)
    # the browsers of this file share one page, which must stay for the second
    own = SimpleNamespace(reset=lambda: None, add_markdown=lambda _: None)
    monkeypatch.setattr(first._client, "gui", own)
    changed(first, "control.feedback", 5.0)
    wait_for(lambda: served.failures)
    assert isinstance(served.failures[0], ZeroDivisionError)
    assert list(served.sessions) == [2]
    assert second._thread.is_alive()


# Drag mode ------------------------------------------------------------------------------------------------------


def dragging(served, number):
    """Return a session in drag mode."""
    served._open(browser(served, number))
    session = wait_for(lambda: served.sessions.get(number))
    wait_for(lambda: session.answer is not None)
    session._mode.value = "drag"
    session._choose_mode(SimpleNamespace(client=object()))
    wait_for(lambda: session.drag is not None or served.failures or "ff2d2d" in session._said.content, 300.0)
    assert "ff2d2d" not in session._said.content, session._said.content
    assert served.failures == []
    return session


def moved(session, position):
    """Move the gizmo, as a mouse does."""
    session._hand._gizmo.position = position
    session._hand._ask(session._hand._lead)


def test_a_session_leads_its_arm_and_ends_it(served):
    session = dragging(served, 11)
    drag, start = session.drag, session.drag.pose
    moved(session, [start[0] + 0.1, *start[1:3]])
    wait_for(lambda: drag.pose[0] > start[0] + 0.09, 60.0)
    session._hand._ask(lambda one: session._hand._nudge("+y", one))
    wait_for(lambda: drag.goal[1] == pytest.approx(start[1] + session._hand._unit))
    session._hand._ask(lambda one: one.jog(0, one.q[0] + 0.2))
    wait_for(lambda: drag.joints is not None)
    changed(session, "control.inverse.damping.maximum", 0.05)  # acts on the arm as it moves
    wait_for(lambda: session.drag.values == {"control.inverse.damping.maximum": 0.05})
    assert session.drag.joints is not None
    session._ask_to_save(None)
    wait_for((served.out / "test.explore.yaml").is_file, 60.0)
    assert "0.05" in (served.out / "test.explore.yaml").read_text()
    session._hand._return("arm to the start")
    wait_for(lambda: session.drag.joints is None and np_allclose(session.drag.pose, start))
    session._mode.value = "run"
    session._choose_mode(SimpleNamespace(client=object()))
    wait_for(lambda: session.drag is None and not session._is_asked)
    assert served.failures == []
    served._leave(SimpleNamespace(client_id=11))
    session._thread.join(30)
    assert not session._thread.is_alive()


def np_allclose(one, other):
    return abs(one - other).max() < 1e-3


def test_an_error_in_drag_mode_ends_that_session_alone(served, monkeypatch):
    first, second = dragging(served, 12), dragging(served, 13)
    monkeypatch.setattr(first.drag, "advance", lambda _: 1 / 0)
    first._hand._ask(lambda drag: drag.lead(drag.goal))
    wait_for(lambda: served.failures)
    assert isinstance(served.failures[0], ZeroDivisionError)
    assert list(served.sessions) == [13]
    assert second._thread.is_alive()


@pytest.mark.long
def test_many_random_moves_neither_leak_memory_nor_stop_the_answers(served):
    # MOVES=1800 are an hour of a reader who moves something every two seconds, in both modes
    moves, parts = int(os.environ.get("MOVES", "320")), 8
    chance, session = random.Random(0), dragging(served, 14)
    sliders = [
        one for one in session.controls if one.step and "delay" not in one.key and "lag" not in one.key
    ]
    sizes = []
    for i in range(moves):
        if i % (moves // parts) == 0 and i:
            session._mode.value = "run" if session._drags else "drag"
            session._choose_mode(SimpleNamespace(client=object()))
        if chance.random() < 0.5 and session.drag is not None:
            moved(session, [chance.uniform(-2.0, 2.0), chance.uniform(-2.0, 2.0), 0.0])
        else:
            one = chance.choice(sliders)
            changed(session, one.key, round(chance.uniform(one.low, one.high), 9))
        wait_for(lambda: not session._is_asked, 60.0)
        if i % (moves // parts) == moves // parts - 1:
            gc.collect()
            sizes.append(memory())
    assert max(sizes[3:]) <= 1.05 * sizes[2]  # both modes are warm after three parts
    assert session._thread.is_alive()
    assert served.failures == []


def memory():
    """Return the resident memory of this process [kB]."""
    with open("/proc/self/status", encoding="ascii") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmRSS"))


def test_the_textbook_is_a_page_of_the_server_with_the_rows_that_are_linked(served):
    with closing(http.client.HTTPConnection("127.0.0.1", port_of(served))) as line:
        line.request("GET", "/textbook")
        answer = line.getresponse()
        text, policy = answer.read().decode(), answer.headers["Content-Security-Policy"]
    assert answer.status == 200
    assert "default-src 'none'" in policy
    assert "http" not in text
    linked = rows.links("null_space", ["A39"])
    assert re.findall(r"\[(\w+)\]\(textbook#", linked) == [
        "A36",
        "A39",
        "A40",
    ]  # A40 runs it; a lesson has A36
    for key in ("A39", "A40"):
        assert f'<tr id="{key}">' in text
    # no row runs this one; its lesson names some
    assert re.findall(r"\[(\w+)\]\(textbook#", rows.links("approach_singularity")) == ["A21", "C7", "D10"]
    assert rows.links("none_of_this_name") == ""

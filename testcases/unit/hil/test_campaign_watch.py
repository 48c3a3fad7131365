"""The page of a running campaign: who gets in, what it shows, stop and resume."""

import json
import time
from contextlib import contextmanager
from http.client import HTTPConnection
from socket import create_server

import pytest

from hil.campaign import Runner, RunOptions
from hil.cockpit.campaign_watch import CampaignWatch
from hil.cockpit.watch_server import served_watch
from reports import remember
from reports.model import CaseResult, Check, Verdict
from testcases.unit.hil.test_hil_runner import toy_cases

pytestmark = pytest.mark.exhaustive


class Page:
    """A page that came in with the token."""

    def __init__(self, address):
        self.host, _, token = address.removeprefix("http://").partition("/#token=")
        status, headers, _ = self.ask("POST", "/enter", token)
        assert status == 204
        self.cookie = headers["set-cookie"].partition(";")[0]

    def ask(self, method, path, body="", **headers):
        connection = HTTPConnection(self.host, timeout=30)
        try:
            connection.request(method, path, body, {"host": self.host, **headers})
            answer = connection.getresponse()
            found = {name.lower(): value for name, value in answer.getheaders()}
            return answer.status, found, answer.read().decode()
        finally:
            connection.close()

    def get(self, path):
        return self.ask("GET", path, cookie=self.cookie)

    def post(self, path, **headers):
        return self.ask("POST", path, cookie=self.cookie, **headers)[0]

    def state(self, since=0):
        return json.loads(self.get(f"/state?since={since}")[2])


@contextmanager
def served(watch):
    with served_watch(watch, create_server(("127.0.0.1", 0))) as address:
        yield Page(address)


def result(name, verdict=Verdict.PASSED):
    check = Check("alarm", verdict, "alarm 421", "none", 1.0, sentence="Alarm 421 did not come")
    return CaseResult(name, f"title of {name}", verdict, checks=[check], wall_s=2.0)


def test_what_the_page_gets_and_who_gets_it(tmp_path, subtests):
    """Counts, pace, estimated rest and running cases; the report of a case in a sandbox of its own; nothing
    without the cookie, for another host, or by a page of another origin.
    """
    clock = [100.0]
    watch = CampaignWatch("our stops", 10, workers=2, history=tmp_path / "h.sqlite", clock=lambda: clock[0])
    watch.case_began("a")
    watch.case_began("b")
    clock[0] += 4.0
    watch.case_done(result("a"))
    watch.case_done(result("b", Verdict.FAILED))
    watch.case_began("c")
    clock[0] += 1.0
    with served(watch) as page:
        state = page.state()
        assert (state["done"], state["total"], state["stage"], state["workers"]) == (2, 10, "running", 2)
        assert (state["counts"]["passed"], state["counts"]["failed"]) == (1, 1)
        assert (state["elapsed_s"], state["per_minute"], state["left_s"]) == (5.0, 30.0, 16.0)
        assert state["running"] == [{"case": "c", "for_s": 1.0}]
        assert [(row["case"], row["headline"]) for row in state["results"]] == [
            ("a", ""),
            ("b", "Alarm 421 did not come"),
        ]
        assert [row["case"] for row in page.state(since=1)["results"]] == ["b"]
        status, headers, text = page.get("/case/1")
        assert status == 200
        assert "title of b" in text
        assert headers["content-security-policy"].startswith("sandbox allow-scripts; default-src 'none'")
        assert "default-src 'none'" in page.get("/")[1]["content-security-policy"]
        assert json.loads(page.get("/history")[2]) == []
        for path, expected in (
            ("/case/9", 404),
            ("/state?since=x", 400),
            ("/compare?base=1&now=2", 404),
            ("/page/watch.js", 200),
        ):
            with subtests.test(path):
                assert page.get(path)[0] == expected
        for method, path in (("GET", "/state"), ("GET", "/case/1"), ("GET", "/history"), ("POST", "/stop")):
            with subtests.test(f"{path} without cookie"):
                assert page.ask(method, path)[0] == 401
            with subtests.test(f"{path} by another origin or host"):
                origin = {"cookie": page.cookie, "origin": "http://evil.example"}
                assert page.ask(method, path, **origin)[0] == 403
                assert page.ask(method, path, cookie=page.cookie, host="evil.example")[0] == 403
        assert not watch.stopping


def test_a_run_is_stopped_goes_on_and_is_compared(tmp_path):
    """Stop lets no further case begin; resume runs the others; runs of the history are compared."""
    cases = toy_cases()
    history = tmp_path / "history.sqlite"
    watch = CampaignWatch("toy", len(cases), workers=1, history=history)
    with served(watch) as page:

        def done(case, number, total):
            watch.case_done(case)
            if number == 2:
                assert page.post("/stop") == 204

        def run(**options):
            return Runner(
                cases,
                RunOptions(directory=tmp_path / "run", **options),
                on_result=done,
                on_begin=watch.case_began,
                stop=lambda: watch.stopping,
            ).run()

        first = run()
        assert (len(first.cases), first.interrupted) == (2, True)
        watch.paused(finished=False)
        state = page.state()
        assert (state["stage"], state["done"], state["running"], state["left_s"]) == ("stopped", 2, [], None)
        assert page.post("/resume", origin=f"http://{page.host}") == 204
        assert watch.wait_for_orders()
        watch.resumed()
        second = run(resume=True)
        assert (len(second.cases), second.interrupted) == (len(cases), False)
        assert [row["case"] for row in page.state()["results"]] == [one.case.identifier for one in cases]
        remember(second, history)
        second.started = "later"
        second.cases[0].verdict = Verdict.FAILED
        remember(second, history)
        assert [one["number"] for one in json.loads(page.get("/history")[2])] == [2, 1]
        compared = json.loads(page.get("/compare?base=1&now=2")[2])
        assert compared["new_failure"] == [second.cases[0].identifier]
        watch.paused(finished=True)
        assert page.post("/end") == 204
        began = time.monotonic()
        assert not watch.wait_for_orders()
        assert time.monotonic() - began < 5.0

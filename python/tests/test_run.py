"""The whole method: the same bytes and words as the command line; it can be followed and stopped."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.parse
from functools import partial
from pathlib import Path

import pytest

import stonewise

FILES = ["data/stones.parquet", "stones.csv", "data/matches.json", "data/m3c2.csv", "data/outlines.json"]


def assert_same_bytes(one: Path, other: Path) -> None:
    for name in FILES:
        assert (one / name).read_bytes() == (other / name).read_bytes(), name


def test_same_bytes_as_the_command(command, survey, results, tmp_path):
    command("run", "--quiet", survey / "stonewise.toml", "--out", tmp_path / "out")
    assert_same_bytes(results.path, tmp_path / "out")


@pytest.mark.skipif("STONEWISE" not in os.environ, reason="STONEWISE names no command that cargo built")
def test_same_bytes_as_the_command_that_cargo_builds(survey, results, tmp_path):
    args = [os.environ["STONEWISE"], "run", "--quiet", str(survey / "stonewise.toml"), "--out", str(tmp_path / "out")]
    subprocess.run(args, check=True)
    assert_same_bytes(results.path, tmp_path / "out")


def test_parameters_are_those_of_the_project_file(command, survey, results, tmp_path):
    changed = stonewise.run(
        survey / "stonewise.toml",
        out=tmp_path / "python",
        registration={"estimator": "gicp", "epoch_error_m": 0.001},
        match={"max_ratio": 0.5},
    )
    assert changed.parameters["registration"]["estimator"] == "gicp"
    assert changed.datum == {results.epochs[1]: "stated"}
    project = survey / "changed.toml"
    text = (survey / "stonewise.toml").read_text()
    assert "[registration]" not in text and "[match]" not in text
    project.write_text(text + '\n[registration]\nestimator = "gicp"\nepoch_error_m = 0.001\n[match]\nmax_ratio = 0.5\n')
    command("run", "--quiet", project, "--out", tmp_path / "command")
    assert_same_bytes(changed.path, tmp_path / "command")
    assert changed.stones_arrow != results.stones_arrow


def test_errors_have_the_words_of_the_command(command, survey, tmp_path):
    wrong = survey / "wrong.toml"
    wrong.write_text((survey / "stonewise.toml").read_text() + "\n[match]\nmax_ration = 0.5\n")
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "thesis.tex").write_text("mine")
    for project, out, code in [
        (wrong, tmp_path / "a", "project-file"),
        (survey / "missing.toml", tmp_path / "a", "no-project"),
        (survey / "stonewise.toml", foreign, "output-folder"),
    ]:
        said = command("run", project, "--out", out, expect=2).stderr.strip().splitlines()[-1]
        with pytest.raises(stonewise.Error) as raised:
            stonewise.run(project, out=out)
        assert said == f"error: {raised.value} [{code}]"


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"match": {"max_ration": 0.5}}, "match: unknown field `max_ration`"),
        ({"matches": {}}, "unknown field `matches`"),
        ({"match": {"max_ratio": "much"}}, "match: invalid type"),
        ({"match": {"min_area_ratio": 1.5}}, "match.min_area_ratio = 1.5 is not possible: it must be 0 to 1"),
        ({"segment": {"model": "no.safetensors"}}, "no such file"),
    ],
)
def test_wrong_parameters_are_named(survey, tmp_path, parameters, words):
    with pytest.raises(stonewise.Error, match=words):
        stonewise.run(survey, out=tmp_path / "out", **parameters)
    assert not (tmp_path / "out").exists()


def test_progress_is_told_and_other_threads_go_on(survey, tmp_path):
    told, ticks, ended = [], 0, threading.Event()

    def tick() -> None:
        nonlocal ticks
        while not ended.is_set():
            ticks += 1
            time.sleep(0.001)

    ticking = threading.Thread(target=tick)
    ticking.start()
    started = time.monotonic()
    try:
        stonewise.run(survey, out=tmp_path / "out", progress=lambda *args: told.append(args))
    finally:
        ended.set()
        ticking.join()
    # The place of the step, and what is at work in it.
    tasks = {what for what, _, _ in told}
    for words in ["2/6 find the stones, masks", "4/6 measure the motions, iteration 1", "5/6 compare the clouds, M3C2"]:
        assert words in tasks, sorted(tasks)
    assert all(0 <= done <= total for _, done, total in told)
    assert ticks > 10 * (time.monotonic() - started)


def test_an_exception_of_the_callback_stops_the_run(survey, results, tmp_path):
    class Enough(Exception):
        pass

    def stop(what: str, done: int, total: int) -> None:
        if what.endswith(", labels"):
            raise Enough

    with pytest.raises(Enough):
        stonewise.run(survey / "stonewise.toml", out=tmp_path / "out", progress=stop)
    with pytest.raises(stonewise.Error, match="no results here"):
        stonewise.open(tmp_path / "out")
    resumed = stonewise.run(survey / "stonewise.toml", out=tmp_path / "out")
    assert any(step["resumed"] for step in resumed.record["steps"])
    assert_same_bytes(results.path, resumed.path)


@pytest.mark.skipif(os.name == "nt", reason="signals of Unix")
@pytest.mark.parametrize("program", ["module", "command"])
def test_control_c(survey, results, tmp_path, program):
    project, out = str(survey / "stonewise.toml"), str(tmp_path / "out")
    script = f"import stonewise; stonewise.run({project!r}, out={out!r}, progress=lambda w, d, t: print(w, flush=True))"
    args = {
        "module": [sys.executable, "-c", script],
        "command": [sys.executable, "-m", "stonewise", "run", project, "--out", out],
    }[program]
    # Programs that a shell starts in the background ignore Ctrl-C, and so would those that they start.
    heed = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    stopped = subprocess.Popen(args, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, preexec_fn=heed)
    lines = []
    for line in stopped.stdout:
        lines.append(line)
        if "stones in the clouds" in line:
            stopped.send_signal(signal.SIGINT)
            break
    said = "".join(lines) + stopped.stdout.read()
    assert stopped.wait(60) != 0
    assert ("KeyboardInterrupt" if program == "module" else "interrupted") in said
    resumed = stonewise.run(project, out=out)
    assert_same_bytes(results.path, resumed.path)


def test_doubts_are_warnings(survey, tmp_path):
    project = survey / "doubtful.toml"
    text = (survey / "stonewise.toml").read_text()
    project.write_text(text + "\n[[registration.stable]]\ncorners = [[90.0, 90.0, 90.0], [91.0, 91.0, 91.0]]\n")
    with pytest.warns(stonewise.Doubt, match="registration.stable"):
        r = stonewise.run(project, out=tmp_path / "out")
    assert any(w.skipped_input for w in r.warnings)


def test_the_command_answers_as_commands_do(command):
    assert command("--version").stdout.strip() == f"stonewise {stonewise.__version__}"
    assert "Usage: stonewise run" in command("run", "--help").stdout
    assert "unexpected argument" in command("run", "--nonsense", expect=2).stderr


def test_simulated_surveys_have_the_bytes_of_the_command(command, tmp_path):
    parameters = {
        "scene": {"seed": 5, "wall": {"width_m": 1.2, "height_m": 0.8}, "tls": {"spacing_m": 0.02}},
        "photos": {"columns": 1, "rows": 1, "width": 400, "height": 300, "focal_px": 550.0, "distance_m": 5.0},
    }
    heard = []
    project = stonewise.simulate(tmp_path / "python", progress=lambda *told: heard.append(told), **parameters)
    assert project == tmp_path / "python" / "stonewise.toml" and heard
    command("test", "simulate", "--quiet", "--params", project.with_name("simulation.toml"), "--out", tmp_path / "command")
    for name in ("stonewise.toml", "epoch2/cloud_tls.laz", "epoch1/images/IMG_1001.jpg", "truth/stones.csv"):
        assert (tmp_path / "python" / name).read_bytes() == (tmp_path / "command" / name).read_bytes(), name


def test_a_wrong_parameter_of_a_simulation_is_named(tmp_path):
    with pytest.raises(stonewise.Error, match="unknown field `hight_m`"):
        stonewise.simulate(tmp_path / "out", scene={"wall": {"hight_m": 1.0}})
    assert not (tmp_path / "out").exists()


def test_the_studio_runs_until_it_is_closed(survey):
    with stonewise.studio(survey, browser=False) as page:
        assert page.is_running and page.address in page._repr_html_()
        host, port = urllib.parse.urlsplit(page.address).netloc.split(":")
        with socket.create_connection((host, int(port)), timeout=10):
            pass
    assert not page.is_running


def test_a_studio_that_cannot_open_says_why(command, tmp_path):
    said = command("studio", "--no-browser", tmp_path / "missing", expect=None).stderr.strip().splitlines()[-1]
    with pytest.raises(stonewise.Error) as raised:
        stonewise.studio(tmp_path / "missing", browser=False)
    assert str(raised.value) in said and "missing" in str(raised.value)

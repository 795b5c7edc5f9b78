"""The executable: exit statuses, one-line messages, files written whole or not at all."""

from __future__ import annotations

import csv
import os
import re
import resource
import signal
import subprocess
import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomli_w
import xarray as xr

import linkdyn
import sheet_file
from linkdyn.cli import executable, quadruple_twin

ROOT = Path(__file__).resolve().parents[2]
BAD_SCENES = sorted((Path(__file__).parent / "bad_scenes").glob("*.toml"))
DONE, BAD_INPUT, SAMPLES_FAILED = 0, 2, 3
WHAT = {"elimination": "driving_force,reaction", "reduced": "driving_force"}
"""What the summary shows."""


def run(*arguments, **options) -> subprocess.CompletedProcess:
    return subprocess.run(
        [executable(), *map(str, arguments)], capture_output=True, text=True, errors="replace", timeout=120, **options
    )


def refused(result: subprocess.CompletedProcess, *fragments: str) -> None:
    """One line on standard error, nothing on standard output, exit status 2."""
    assert result.returncode == BAD_INPUT, result
    assert result.stdout == ""
    assert result.stderr.count("\n") == 1 and result.stderr.endswith("\n"), result.stderr
    for fragment in fragments:
        assert fragment in result.stderr


@pytest.mark.parametrize("file", BAD_SCENES, ids=lambda file: file.stem)
def test_bad_scene_is_refused_in_one_line(file, tmp_path):
    first_line = file.read_bytes().split(b"\n", 1)[0].decode()
    assert first_line.startswith("# expect: ")
    fragment = first_line.removeprefix("# expect: ").strip()
    refused(run("inverse", file, cwd=tmp_path), str(file), fragment)
    assert list(tmp_path.iterdir()) == []
    if "actuators" in file.stem:    # wrong for inverse dynamics only
        with pytest.raises(linkdyn.LinkdynError):
            linkdyn.load(file).inverse()
        return
    refused(run("explain", file, cwd=tmp_path), str(file), fragment)
    with pytest.raises(linkdyn.SceneError, match=re.escape(fragment)):
        linkdyn.load(file)


@pytest.mark.parametrize("encoding, hint", [("latin-1", "; save the text as UTF-8"), ("utf-16", "; this is UTF-16, save the text as UTF-8")])
def test_other_encodings_are_named(encoding, hint, tmp_path):
    text = (ROOT / "examples" / "fourbar" / "scene.toml").read_text(encoding="utf-8")
    (tmp_path / "scene.toml").write_bytes(f"# Getriebe für Türen\n{text}".encode(encoding))
    refused(run("inverse", tmp_path / "scene.toml"), "scene.toml:1: this is not TOML", hint)


@pytest.mark.parametrize("form", [lambda text: text.replace("\n", "\r\n"), lambda text: "\ufeff" + text], ids=["lines of Windows", "byte order mark"])
def test_texts_of_windows_are_read(form, tmp_path):
    text = (ROOT / "examples" / "fourbar" / "scene.toml").read_text(encoding="utf-8")
    (tmp_path / "scene.toml").write_bytes(form(text).encode())
    assert run("inverse", tmp_path / "scene.toml", "-o", tmp_path / "run.nc").returncode == DONE


@pytest.mark.thorough
@pytest.mark.parametrize("twin", [False, pytest.param(True, marks=pytest.mark.twin)])
def test_study(twin, tmp_path):
    """Every method is measured; a tighter tolerance errs less; the advice is good enough; the reference is named."""
    scene = ROOT / "examples" / "fourbar" / "scene.toml"
    environment = os.environ | {"LINKDYN_REAL128": str(quadruple_twin()) if twin else str(tmp_path / "none")}
    result = run("study", scene, "--until", "1", cwd=tmp_path, env=environment)
    assert result.returncode == DONE and result.stderr == ""
    assert ("against the quadruple twin" if twin else "is not built") in result.stdout
    rows = list(csv.DictReader((tmp_path / "fourbar_study.csv").open()))
    inverse = {row["method"]: float(row["error [1]"]) for row in rows if row["analysis"] == "inverse"}
    assert set(inverse) == {"gauss-jordan", "lapack", "elimination", "reduced", "gauss-jordan-plain"}
    # a hundred eps: well-conditioned equations of nine unknowns
    assert max(inverse.values()) < 100 * np.finfo(float).eps
    rk4 = [float(row["error [1]"]) for row in rows if row["method"] == "rk4"]
    # steps shrink by four: order 4 gains a factor 256 until rounding; what takes seconds, as it may in a checked build, ends the ladder
    assert len(rk4) >= 3 and rk4[1] < rk4[0] / 100 and rk4[2] < rk4[1] / 100
    advice = re.search(r"for 1e-6 use (\S+), (tol \S+|step .+ s): ", result.stdout)
    assert advice
    chosen = [row for row in rows if (row["method"], row["setting"]) == advice.groups()]
    assert float(chosen[0]["error [1]"]) <= 1e-6
    refused(run("study", scene, "--csv", cwd=tmp_path), "--csv")
    refused(run("study", scene, "--until", "-1", "-q", cwd=tmp_path), "a run from 0 s to -1 s has no duration")


def test_states_are_the_motion(tmp_path):
    """Results as CSV are states: computed from them, all forces come again to the last bit; wrong files are refused."""
    scene = ROOT / "examples" / "fourbar" / "scene.toml"
    assert run("inverse", scene, "--csv", "-o", "a.csv", "-q", cwd=tmp_path).returncode == DONE
    assert run("inverse", scene, "--states", "a.csv", "--csv", "-o", "b.csv", "-q", cwd=tmp_path).returncode == DONE
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    (tmp_path / "degrees.csv").write_text("q J1 [deg],note\n90,ok\n")
    (tmp_path / "radians.csv").write_text(f"q J1\n{np.pi / 2!r}\n")
    for name in ("degrees", "radians"):
        assert run("inverse", scene, "--states", f"{name}.csv", "--csv", "-o", f"{name}_out.csv", "-q", cwd=tmp_path).returncode == DONE
    assert (tmp_path / "degrees_out.csv").read_text() == (tmp_path / "radians_out.csv").read_text()
    for text, *fragments in (("qd J1\n1\n", "no column 'q J1'"), ("q J1 [mm]\n1\n", "unit"), ("q J1\n1\nabc\n", "bad.csv:3"),
                           ("q J1,qd J\n1,2\n", "column 'qd J': there is no coordinate 'J'; did you mean 'J1'?"),
                           ("t [ms],q J1\n1,2\n", "column 't': instants are not called so (expected 'time')"),
                           ("tmie,q J1\n1,2\n", "column 'tmie': instants are not called so"),
                           ("Zeit [s],q J1\n1,2\n", "column 'Zeit': instants are not called so (expected 'time')"),
                           ("q J1,Qd J1\n1,2\n", "column 'Qd J1'", "did you mean 'qd J1'?"),
                           ("q J1;Qd J1\n1;2,5\n", "column 'Qd J1'", "did you mean 'qd J1'?"),
                           ("q J1,qdd J1,dq J1\n1,2,3\n", "did you mean 'qd J1'?"),
                           ("q J1,qd  J1\n1,2\n", "did you mean 'qd J1'?"),
                           ("q J1,rate J1\n1,2\n", "column 'rate J1': no state and no result of the scene is called so"),
                           ("q J1 (deg)\n1\n", "the unit belongs in square brackets: 'q J1 [deg]'"),
                           ("time (s),q J1\n0,1\n1,2\n", "the unit belongs in square brackets: 'time [s]'"),
                           ("q J1;note\n1;a\n1,5;b\n", "bad.csv:3: column 'q J1'", "expected a decimal point, not a comma"),
                           ("q J1\n1\n1,5\n", "bad.csv:3", "if these are decimal commas"),
                           ("q J1 [Grad]\n90\n", "did you mean 'deg'?")):
        (tmp_path / "bad.csv").write_text(text)
        refused(run("inverse", scene, "--states", "bad.csv", cwd=tmp_path), "bad.csv", *fragments)
    refused(run("forward", scene, "--states", "a.csv", cwd=tmp_path), "--states", "linkdyn inverse")


def test_states_of_positions_alone(tmp_path):
    """Along a motion the rates are those of a cubic through the positions, which a spline keeps; each on its own is at rest."""
    scene, t = ROOT / "examples" / "fourbar" / "scene.toml", np.linspace(0, 0.3, 7)
    q, qd, qdd = 1 + 2 * t - 3 * t**2 + 4 * t**3, 2 - 6 * t + 12 * t**2, -6 + 24 * t
    for name, columns in (("alone", {"time": t, "q J1": q}), ("whole", {"time": t, "q J1": q, "qd J1": qd, "qdd J1": qdd}),
                          ("some", {"time": t, "q J1": q, "qd J1": qd}), ("late", {"time": t[::-1], "q J1": q}), ("still", {"q J1": q})):
        rows = [",".join(columns), *(",".join(map(repr, map(float, row))) for row in zip(*columns.values()))]
        (tmp_path / f"{name}.csv").write_text("\n".join(rows))
    for name in ("alone", "whole", "still"):
        said = run("inverse", scene, "--states", f"{name}.csv", "-o", f"{name}.nc", cwd=tmp_path)
        assert said.returncode == DONE and ("spline through the positions" in said.stdout) == (name == "alone")
    alone, whole, still = (linkdyn.read(tmp_path / f"{name}.nc") for name in ("alone", "whole", "still"))
    assert alone.rates == "of the spline through the positions" and "rates" not in whole.attrs
    for result, size in (("qd", 1), ("qdd", 1), ("driving_force", abs(whole.driving_force).max())):
        np.testing.assert_allclose(alone[result], whole[result], rtol=0, atol=1e-11 * float(size))
    assert not still.qd.any() and not still.qdd.any()
    refused(run("inverse", scene, "--states", "some.csv", cwd=tmp_path), "some.csv", "no column 'qdd J1'", "positions alone")
    refused(run("inverse", scene, "--states", "late.csv", cwd=tmp_path), "late.csv:3", "'time' does not increase")


def mean_square(t, force, ok):
    """Over the gaps, half of each for the sample on either side; the first and the last stand for their whole gap."""
    gap = np.diff(t)
    square, weight = np.where(ok, force, 0) ** 2, ok.astype(float)
    total = [float((gap / 2) @ (x[:-1] + x[1:]) + gap[0] / 2 * x[0] + gap[-1] / 2 * x[-1]) for x in (square, weight)]
    return total[0] / total[1]


def printed_rms(said):
    """Of the only actuator, or of the first."""
    lines = said.stdout.splitlines()
    return float(lines[next(i for i, line in enumerate(lines) if line.endswith(" rms")) + 1].split()[-1])


@pytest.mark.thorough
@pytest.mark.parametrize("threads", [1, 2])
def test_one_rms(threads, tmp_path):
    """Uneven instants over several blocks, samples that fail in the middle and beside blocks' ends: summary, accessor and sheet."""
    scene, n = ROOT / "tests" / "assemblies" / "crank_out_of_reach.toml", 40000
    t = 3 * np.linspace(0, 1, n) ** 2.5
    q = 0.5 * np.sin(3 * t) + np.pi * (np.isin(np.arange(n), [2047, 16384, 20000, 30001]))
    qd = 1.5 * np.cos(3 * t)
    rows = np.column_stack([t, q, qd, 40 * np.exp(-t)])
    np.savetxt(tmp_path / "motion.csv", rows, delimiter=",", header="time,q A,qd A,qdd A", comments="", fmt="%.17g")
    options = ("--states", "motion.csv", "--threads", threads)
    written = run("inverse", scene, *options, "-o", "run.nc", cwd=tmp_path)
    passing = run("inverse", scene, *options, "--no-output", cwd=tmp_path)
    data = linkdyn.read(tmp_path / "run.nc")
    ok = data.status.values == 0
    assert np.count_nonzero(~ok) == 4 and "4 of 40000" in written.stdout
    force = data.driving_force.values[:, 0]
    want = np.sqrt(mean_square(t, force, ok))
    assert abs(np.sqrt(np.mean(force[ok] ** 2)) / want - 1) > 0.05, "each alike would be another number"
    assert float(data.linkdyn.rms()[0]) == pytest.approx(want, rel=1e-12)
    assert printed_rms(written) == printed_rms(passing) == pytest.approx(want, rel=1e-5)
    _, tables = sheet_file.read(linkdyn.sheet(data, tmp_path / "run.html"))
    assert sheet_file.column(tables["Drives"], 5)[0] == pytest.approx(want, rel=1e-12)


def test_one_rms_of_few_samples_and_of_poses(tmp_path):
    """Poses have no time: each counts alike. Of two samples either stands for their gap, one is its own."""
    scene, q = ROOT / "examples" / "fourbar" / "scene.toml", [0.3, 1.1, 1.2, 4.0]
    for name, text in (("poses", "q J1\n" + "".join(f"{x}\n" for x in q)), ("two", "time,q J1,qd J1,qdd J1\n0,0.3,0,0\n1,1.1,0,0\n"),
                       ("one", "time,q J1,qd J1,qdd J1\n0,0.3,0,0\n")):
        (tmp_path / f"{name}.csv").write_text(text)
        said = run("inverse", scene, "--states", f"{name}.csv", "-o", f"{name}.nc", cwd=tmp_path)
        data = linkdyn.read(tmp_path / f"{name}.nc")
        want = float(np.sqrt((data.driving_force.values[:, 0] ** 2).mean()))
        assert float(data.linkdyn.rms()[0]) == pytest.approx(want, rel=1e-12) and printed_rms(said) == pytest.approx(want, rel=1e-5)


def test_one_rms_of_a_run_that_an_event_ends(tmp_path):
    """The last gap is shorter than the others."""
    text = (ROOT / "examples" / "fourbar_start" / "scene.toml").read_text()
    event = '[measures]\nangle = { joint = "J1" }\n[[event]]\nname = "there"\nwhen = "angle - 0.55 rad"\ndo = "stop"\n'
    (tmp_path / "scene.toml").write_text(f"{text}\n{event}")
    said = run("forward", "scene.toml", "--until", 2, "--samples", 11, "-o", "run.nc", cwd=tmp_path)
    assert said.returncode == DONE, said
    data = linkdyn.read(tmp_path / "run.nc")
    t, force = data.time.values, data.driving_force.values[:, 0]
    assert len(t) > 3 and t[-1] - t[-2] < 0.19
    want = np.sqrt(mean_square(t, force, np.ones(len(t), dtype=bool)))
    assert float(data.linkdyn.rms()[0]) == pytest.approx(want, rel=1e-12) and printed_rms(said) == pytest.approx(want, rel=1e-5)


def test_version_and_help():
    version = run("--version")
    assert version.returncode == DONE and version.stdout == f"linkdyn {linkdyn.__version__}\n"
    general = run("--help")
    assert general.returncode == DONE and "linkdyn inverse SCENE" in general.stdout
    assert run().stdout == general.stdout
    inverse = run("inverse", "--help")
    assert inverse.returncode == DONE
    for option in ("--output", "--csv", "--want", "--solver", "--threads", "--quiet", "--compress", "--no-output"):
        assert option in inverse.stdout
    assert run("explain", "--help").returncode == DONE


@pytest.mark.parametrize(
    ("arguments", "fragments"),
    [
        (["inverze"], ["'inverze'", "did you mean 'inverse'"]),
        (["--verson"], ["'--verson'", "did you mean '--version'"]),
        (["inverse"], ["no scene given"]),
        (["inverse", "SCENE", "--solvr", "lapack"], ["'--solvr'", "did you mean '--solver'"]),
        (["inverse", "SCENE", "--solver", "lapak"], ["'lapak'", "did you mean 'lapack'"]),
        (["inverse", "SCENE", "--solver"], ["--solver", "value missing"]),
        (["inverse", "SCENE", "--want", "forces"], ["'forces'", "driving_force"]),
        (["inverse", "SCENE", "--threads", "0"], ["--threads", "'0'"]),
        (["inverse", "SCENE", "--threads=two"], ["--threads", "'two'"]),
        (["inverse", "SCENE", "--csv=yes"], ["--csv", "takes no value"]),
        (["inverse", "SCENE", "SCENE"], ["a second scene"]),
        (["inverse", ""], ["no name"]),
        (["sweep", "SCENE", "-o", "run.csv"], ["'run.csv'", ".nc"]),
        (["study", "SCENE", "-o", "run.nc"], ["'run.nc'", ".csv"]),
        (["inverse", "SCENE", "--solver", "reduced", "--want", "reaction"], ["reduced", "reaction"]),
        (["inverse", "SCENE", "--no-output", "--csv"], ["--no-output", "--csv"]),
        (["inverse", "SCENE", "--no-output", "-o", "run.nc"], ["--no-output", "--output"]),
        (["explain", "SCENE", "--csv"], ["'--csv'", "unknown option"]),
        (["inverse", "SCENE", "--out", "run.nc"], ["'--out'", "unknown option; did you mean '--output'?"]),
        (["inverse", "SCENE", "-o", "run.xlsx"], ["'run.xlsx'", "expected .nc, or .csv for a spreadsheet"]),
        (["inverse", "SCENE", "-o", "run.parquet"], ["'run.parquet'", "expected .nc; in Python, run.linkdyn.to_parquet)"]),
        (["--version", "--csv"], ["'--csv'"]),
        (["inverse", "SCENE", "-o", "a.nc", "--output=b.nc"], ["--output", "given twice"]),
        (["inverse", "SCENE", "-o", "--csv"], ["-o", "value missing"]),
        (["inverse", "SCENE", "--csv", "--compress"], ["--compress", "--csv"]),
        (["inverse", "SCENE", "-o", "run.csv", "--compress"], ["--compress", "--csv"]),
        (["inverse", "SCENE", "--csv", "-o", "run.nc"], ["--csv", "'run.nc'", "expected .csv"]),
        (["forward", "SCENE", "--method", "rk4", "--rtol", "1e-6"], ["--rtol", "rk4"]),
        (["forward", "SCENE", "--until", "1+2"], ["--until", "'1+2'"]),
        (["forward", "SCENE", "--until", "1e999"], ["--until", "'1e999'"]),
        (["forward", "SCENE", "--checkpoint", "3"], ["'--checkpoint'", "linkdyn forward", "expected with linkdyn sweep"]),
        (["inverse", "no_such_file.toml"], ["no_such_file.toml"]),
        (["inverse", "/"], ["/"]),
    ],
)
def test_wrong_command_line(arguments, fragments, tsai_file, tmp_path):
    refused(run(*(str(tsai_file) if word == "SCENE" else word for word in arguments), cwd=tmp_path), *fragments)
    assert list(tmp_path.iterdir()) == []


COMMANDS = ["inverse", "forward", "sweep", "study", "explain"]
VALUES = {"--until": "1", "--step": "1e-3", "--rtol": "1e-6", "--atol": "1e-6", "--samples": "3", "--threads": "1",
          "--checkpoint": "5", "--method": "rk8pd", "--solver": "lapack", "--want": "checks", "--keep": "driving_force",
          "--output": "x", "--states": "x", "--sheet": "x.html", "--code": "scalar"}


def options_in_help(command: str) -> set[str]:
    """Long options that the help of a command explains."""
    text = run(command, "--help").stdout
    return {word for line in text.splitlines() if re.match(r"  -", line) for word in re.findall(r"--[a-z-]+", line[:24])}


def test_a_command_takes_the_options_of_its_help_and_no_other(tmp_path):
    """What is not in the help is refused by name, and told where it belongs; what is in it gets as far as the missing scene."""
    of = {command: options_in_help(command) for command in COMMANDS}
    everything = set().union(*of.values())
    assert len(everything) >= 23
    for command in COMMANDS:
        for option in sorted(everything - {"--help", "--sheet"}):
            result = run(command, "none.toml", option, *([VALUES[option]] if option in VALUES else []), cwd=tmp_path)
            if option in of[command]:
                refused(result, "none.toml: there is no such file")
            else:
                owners = [name for name in COMMANDS if option in of[name]]
                refused(result, f"'{option}'", f"linkdyn {command}", f"linkdyn {owners[0]}")


@pytest.mark.parametrize("command", ["inverse", "forward"])
def test_help_names_every_result_that_a_run_may_want(command):
    """`forward --want rcond` was there, and nowhere said."""
    told = re.search(r"--want LIST(.*?)\n  -", run(command, "--help").stdout, re.S)[1]
    results = re.findall(r"\w+", re.search(r"expected (.*) or all", run(command, "none.toml", "--want", "none").stderr)[1])
    taken = {name for name in results if "is not a result of" not in run(command, "none.toml", "--want", name).stderr}
    elsewhere = {"inverse": {"controller", "clutch", "cylinder"}, "forward": set()}[command]      # taken, and nothing there
    assert "rcond" in taken and taken - elsewhere == {word for word in re.findall(r"\w+", told) if word in results}


def test_inverse_writes_netcdf_named_after_the_scene(tsai_file, tmp_path):
    result = run("inverse", tsai_file, cwd=tmp_path)
    assert result.returncode == DONE and result.stderr == ""
    assert [file.name for file in tmp_path.iterdir()] == ["stewart_tsai.nc"]
    other = tmp_path / "other.toml"
    other.write_text(tsai_file.read_text())
    assert run("inverse", other, cwd=tmp_path).returncode == DONE
    assert (tmp_path / "other.nc").is_file()


def test_summary_tells_peaks_rms_and_reactions(tsai_file, tmp_path):
    result = run("inverse", tsai_file, "-o", tmp_path / "run.nc")
    rows = {line.split()[0]: line.split() for line in result.stdout.splitlines() if line.startswith("  leg")}
    run_data = linkdyn.load(tsai_file).inverse()
    time = run_data.time.values
    for name in run_data.actuator.values:
        force = run_data.driving_force.sel(actuator=name).values
        got = [float(word) for word in rows[name][2:]]
        # six digits are printed; at equal peaks either instant will do
        expected = [force.min(), time[force.argmin()], force.max(), time[force.argmax()], np.sqrt(np.mean(force**2))]
        np.testing.assert_allclose(got[::2], expected[::2], rtol=1e-5)
        for k in (1, 3):
            at = np.abs(time - got[k]).argmin()
            np.testing.assert_allclose(force[at], got[k - 1], rtol=1e-5)
    largest = np.linalg.norm(run_data.reaction[..., :3], axis=-1).max()
    words = next(line for line in result.stdout.splitlines() if "largest reaction force" in line).split()
    np.testing.assert_allclose(float(words[3]), largest, rtol=1e-5)
    assert "failed samples   none" in result.stdout
    assert str(tmp_path / "run.nc") in result.stdout


def test_quiet_prints_nothing(tsai_file, tmp_path):
    result = run("inverse", tsai_file, "--quiet", "-o", tmp_path / "run.nc")
    assert (result.returncode, result.stdout, result.stderr) == (DONE, "", "")


@pytest.mark.parametrize("solver", ["gauss-jordan", "lapack", "elimination"])
def test_solver_is_used_and_recorded(solver, tsai_file, tmp_path):
    assert run("inverse", tsai_file, f"--solver={solver}", "-q", "-o", tmp_path / "run.nc").returncode == DONE
    with xr.open_dataset(tmp_path / "run.nc") as data:
        assert data.attrs["solver"] == solver
        assert {name for name in ("error", "growth", "rcond") if name in data} == {
            "gauss-jordan": {"growth"}, "lapack": {"error", "rcond"}, "elimination": set()}[solver]
        assert all(np.isfinite(data[name]).all() for name in data.data_vars)


def test_threads_do_not_change_results(tsai_file, tmp_path):
    for n in (1, 2, 3):
        assert run("inverse", tsai_file, "--threads", n, "-q", "-o", tmp_path / f"{n}.nc").returncode == DONE
    with xr.open_dataset(tmp_path / "1.nc") as one:
        for n in (2, 3):
            with xr.open_dataset(tmp_path / f"{n}.nc") as other:
                xr.testing.assert_equal(one, other)


def test_reduced_gives_all_but_the_reactions(tsai_file, tmp_path):
    result = run("inverse", tsai_file, "--solver", "reduced", "-o", tmp_path / "run.nc")
    assert result.returncode == DONE and "reduced" in result.stdout and "no reactions" in result.stdout
    with xr.open_dataset(tmp_path / "run.nc") as data:
        assert "reaction" not in data and "joint_rate" in data
        expected = linkdyn.load(tsai_file).inverse().driving_force
        # 1e-11: rounding of both solvers, conditions below 1e3
        np.testing.assert_allclose(data.driving_force, expected, rtol=0, atol=1e-11 * float(np.abs(expected).max()))
        assert np.isfinite(data.power_imbalance).all()


@pytest.mark.parametrize("solver", ["elimination", "reduced"])
def test_no_output_prints_the_same_summary_and_writes_nothing(solver, tsai, tmp_path):
    tsai["time"]["samples"] = 50_001    # more blocks than threads, the last one not full
    (tmp_path / "long.toml").write_text(tomli_w.dumps(tsai))
    kept = run("inverse", "long.toml", "--solver", solver, "--want", WHAT[solver], "-o", "run.nc", cwd=tmp_path)
    (tmp_path / "run.nc").unlink()

    def figures(text: str) -> list[str]:
        return [line for line in text.splitlines() if not re.match(r"  (\d+ samples|computing time|results)\b", line)]

    for n in (1, 2, 3):
        result = run("inverse", "long.toml", "--solver", solver, "--no-output", "--threads", n, cwd=tmp_path)
        assert result.returncode == DONE and figures(result.stdout) == figures(kept.stdout)
        assert "computing time" in result.stdout
    assert [file.name for file in tmp_path.iterdir()] == ["long.toml"]


def test_no_output_counts_failed_samples(crossing, tmp_path):
    (tmp_path / "crossing.toml").write_text(tomli_w.dumps(crossing))
    result = run("inverse", "crossing.toml", "--no-output", "--threads", 2, cwd=tmp_path)
    assert result.returncode == SAMPLES_FAILED
    assert "1 of 5, first at t = 2" in result.stdout and "1 of 5, first at t = 2" in result.stderr


def test_memory_does_not_grow_with_the_run(tsai, tmp_path):
    def peak(samples: int) -> int:
        """Largest memory [KiB] of a run."""
        tsai["time"]["samples"] = samples
        (tmp_path / "run.toml").write_text(tomli_w.dumps(tsai))
        process = subprocess.Popen([executable(), "inverse", "run.toml", "--no-output", "-q"], cwd=tmp_path)
        _, outcome, usage = os.wait4(process.pid, 0)
        process.returncode = outcome
        assert outcome == 0
        return usage.ru_maxrss

    # the times alone of the longer run would fill 16 MB
    assert peak(2_000_000) < peak(100_000) + 2_000


def test_blocks_join_without_a_seam(tsai, tmp_path):
    tsai["time"]["samples"] = 40001    # more than two blocks of samples
    (tmp_path / "long.toml").write_text(tomli_w.dumps(tsai))
    result = run("inverse", tmp_path / "long.toml", "-q", "--want", "driving_force", "-o", tmp_path / "long.nc")
    assert result.returncode == DONE
    with xr.open_dataset(tmp_path / "long.nc") as data:
        xr.testing.assert_equal(data.load(), linkdyn.Scene(tsai).inverse(want="driving_force"))


def test_csv_reads_back_to_the_same_numbers(tsai_file, tmp_path):
    assert run("inverse", tsai_file, "--csv", cwd=tmp_path).returncode == DONE
    assert run("inverse", tsai_file, "-o", "by_name.csv", cwd=tmp_path).returncode == DONE
    assert (tmp_path / "by_name.csv").read_bytes() == (tmp_path / "stewart_tsai.csv").read_bytes()
    with open(tmp_path / "stewart_tsai.csv", newline="") as file:
        header, *rows = csv.reader(file)
    assert header[0] == "time [s]" and header.count("reaction leg1.S Fx [N]") == 1
    data = linkdyn.load(tsai_file).inverse()
    for name, expected in (
        ("driving_force leg2.P [N]", data.driving_force.sel(actuator="leg2.P")),
        ("reaction leg3.U Mz [N m]", data.reaction.sel(joint="leg3.U", component="Mz")),
        ("qdd platform.z [m/s2]", data.qdd.sel(coordinate="platform.z")),
        ("joint_rate leg6.S.yaw [rad/s]", data.joint_rate.sel(variable="leg6.S.yaw")),
    ):
        column = header.index(name)
        np.testing.assert_array_equal([float(row[column]) for row in rows], expected)
    assert {row[header.index("status")] for row in rows} == {"ok"}


@pytest.mark.parametrize("kind", ["nc", "csv"])
def test_failed_samples_give_status_3(kind, crossing, tmp_path):
    (tmp_path / "crossing.toml").write_text(tomli_w.dumps(crossing))
    result = run("inverse", "crossing.toml", *(["--csv"] if kind == "csv" else []), cwd=tmp_path)
    assert result.returncode == SAMPLES_FAILED
    assert "1 of 5, first at t = 2" in result.stdout and "1 of 5, first at t = 2" in result.stderr
    if kind == "csv":
        rows = (tmp_path / "crossing.csv").read_text().splitlines()
        assert [("NaN" in row) for row in rows[1:]].count(True) >= 1 and len(rows) == 6
        return
    with xr.open_dataset(tmp_path / "crossing.nc") as data:
        np.testing.assert_array_equal(data.status != 0, [False, False, True, False, False])
        np.testing.assert_array_equal(np.isnan(data.reaction).any(("joint", "component")), data.status != 0)


def test_explain(tsai_file):
    result = run("explain", tsai_file)
    assert result.returncode == DONE and result.stderr == ""
    assert result.stdout == linkdyn.load(tsai_file).explain()


@pytest.mark.parametrize("name", ["stewart_tsai", "slider_crank", "valve_train"])
def test_explain_fits_a_page(name):
    """Lists of operations ran past the box of a page, and instants were told as 0.7500E-1."""
    text = linkdyn.load(f"examples/{name}/scene.toml").explain()
    records = text[text.index("\nElimination\n") :].partition("\nLeft out\n")[0]
    assert "products with a sum" in records and max(map(len, records.splitlines())) <= 90
    assert not re.search(r"\bt = \S*E", text)


def test_explain_of_a_pose_in_the_plane():
    """Three coordinates there, six in space."""
    link = {"name": "body", "mass": 1.0, "inertia": 0.1}
    plane = linkdyn.Scene({"space": "planar", "link": [link], "coordinate": [{"link": "body"}]})
    assert "pose of body from its three coordinates" in plane.explain()
    space = linkdyn.Scene({"space": "spatial", "link": [link | {"inertia": [0.1, 0.1, 0.1, 0, 0, 0]}], "coordinate": [{"link": "body"}]})
    assert "pose of body from its six coordinates" in space.explain()


def test_explain_of_a_sweep():
    """Axes that advance together count once: 11 * 11 * 9**4 poses, 14 load cases."""
    report = linkdyn.load(ROOT / "examples" / "stewart_workspace" / "scene.toml").explain()
    assert f"{11 * 11 * 9**4 * 14} samples; of each: driving_force" in report
    assert "rate of platform.x              together with Fz on platform.tool" in report


# ---- files that cannot be written


@pytest.mark.parametrize("options", [[], ["--csv"]], ids=["nc", "csv"])
def test_folder_that_is_not_there(options, tsai_file, tmp_path):
    target = tmp_path / "nowhere" / "run.out"
    refused(run("inverse", tsai_file, "-o", target, *options), f"{target}: cannot be written: there is no folder '{target.parent}'")


def test_output_is_a_folder(tsai_file, tmp_path):
    refused(run("inverse", tsai_file, "-o", tmp_path), "is a folder")
    assert list(tmp_path.iterdir()) == []


def test_folder_without_permission(tsai_file):
    """In the kernel's own folder not even root may make a file."""
    refused(run("inverse", tsai_file, "-o", "/sys/kernel/run.nc"), "/sys/kernel/run.nc: cannot be written: ")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
@pytest.mark.parametrize(
    "arguments", [["explain", "SCENE"], ["inverse", "SCENE", "--no-output"], ["inverse", "--help"], ["--version"]]
)
def test_full_standard_output(arguments, tsai_file):
    """libgfortran would not tell."""
    with open("/dev/full", "w") as full:
        result = subprocess.run(
            [executable(), *(str(tsai_file) if word == "SCENE" else word for word in arguments)],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert result.returncode == BAD_INPUT
    assert result.stderr == "standard output: cannot be written: No space left on device\n"


@pytest.mark.parametrize("options", [[], ["--compress"], ["--csv"]], ids=["nc", "compressed", "csv"])
@pytest.mark.parametrize("is_there", [False, True], ids=["new", "old"])
def test_disk_that_takes_no_more(options, is_there, tsai_file, tmp_path):
    """A limit on the size of files stands for the full disk: writing fails half-way, without root."""
    target = tmp_path / "run.out"
    if is_there:
        target.write_text("earlier results")

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))

    refused(run("inverse", tsai_file, "-o", target, *options, preexec_fn=limit, restore_signals=False),
            f"{target}: cannot be written", "File too large")
    assert [file.read_text() for file in tmp_path.iterdir()] == (["earlier results"] if is_there else [])


def test_interrupted_run_leaves_nothing(tsai, tmp_path):
    tsai["time"]["samples"] = 3_000_001
    (tmp_path / "long.toml").write_text(tomli_w.dumps(tsai))
    process = subprocess.Popen([executable(), "inverse", "long.toml", "--csv"], cwd=tmp_path)
    try:
        while not list(tmp_path.glob("*.part")):
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=60) == -signal.SIGINT
    finally:
        process.kill()
    assert [file.name for file in tmp_path.iterdir()] == ["long.toml"]


def test_pivots_are_not_looked_for_for_ever(tmp_path):
    """A centre of mass light minutes away leaves no pivots; rows were turned into each other without end."""
    scene = tomllib.loads(linkdyn.new("five-bar").text)
    scene["link"][0]["cog"] = [0, 2**63 - 1]
    (tmp_path / "far.toml").write_text(tomli_w.dumps(scene))
    assert subprocess.run([executable(), "explain", "far.toml"], cwd=tmp_path, capture_output=True, timeout=100).returncode == 0


@pytest.mark.parametrize("text", ["[a" + 50_000 * ".a" + "]\nb = 1\n", "b = { a" + 50_000 * ".a" + " = 1 }\n"])
def test_tables_far_too_deep(text, tmp_path):
    """They took the process with them when they were taken down again."""
    (tmp_path / "deep.toml").write_text(text)
    refused(run("explain", tmp_path / "deep.toml"), "deep.toml:1: this is not TOML: a key of too many parts")


def test_results_are_no_scene(tsai_file, tmp_path):
    run("inverse", tsai_file, "-o", tmp_path / "run.nc")
    refused(run("inverse", tmp_path / "run.nc"), "run.nc:1: this is not TOML: but netCDF or HDF5, as results are (expected a scene)")


# ---------------------------------------------------------------- what drives and stops cannot

LIFT = {
    "space": "planar", "gravity": [0, -9.81], "frame": {"markers": {"A": {"at": [0, 0], "axis": [0, 1]}}},
    "link": [{"name": "load", "mass": 1000, "inertia": 1, "markers": {"A": {"at": [0, 0], "axis": [0, 1]}}}],
    "joint": [{"name": "ram", "type": "prismatic", "between": ["frame.A", "load.A"]}],
    "coordinate": [{"joint": "ram", "motion": {"law": "polynomial-345", "from": 0.5, "to": 1.15, "duration": 2}}],
    "actuator": [{"joint": "ram"}], "time": {"end": 2, "samples": 201},
}  # fmt: skip
RAM = {
    "bore": 0.05, "rod": 0.03, "dead_volumes": [3e-4, 3e-4], "bulk_modulus": "1.3 GPa", "tank": "2 bar", "supply": "52 bar",
    "valve": {"flow": "30 litre/min", "drop": "35 bar"},
}  # fmt: skip


def told_alike(scene, tmp_path):
    """Lines of the summary, which are the same where no results are kept, but for times and the file."""
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(scene))
    lines = []
    for option in ((), ("--no-output",), ("--no-output", "--threads", "2")):
        result = run("inverse", "scene.toml", *option, cwd=tmp_path)
        assert result.returncode == DONE, result.stderr
        lines.append([line for line in result.stdout.splitlines() if not line.startswith(("  computing time", "  results")) and "thread" not in line])
    assert lines[0] == lines[1] == lines[2]
    return lines[0]


def test_end_stops_are_told_where_nothing_is_kept(tmp_path):
    """Without results the summary had no word of them."""
    stop = {"name": "end", "joint": "ram", "max": 1.0, "restitution": 0.3}
    told = told_alike({**LIFT, "stop": [stop]}, tmp_path)
    q = linkdyn.Scene(LIFT).inverse().q.values[:, 0]
    assert any(line.startswith(f"  end stops        passed: 'end.max' of joint 'ram' by {(q > 1).sum()} samples, first at t = ") for line in told)


def test_turns_are_counted_up_to_stops(tmp_path):
    """Behind a gear an angle comes to its stop after two turns, whether results are kept or not."""
    scene = {
        "space": "planar", "gravity": [0, 0], "frame": {"markers": {"A": [0, 0], "B": [1, 0]}},
        "link": [{"name": name, "mass": 1, "inertia": 1, "markers": {"O": [0, 0]}} for name in ("motor", "drum")],
        "joint": [{"name": "A", "type": "revolute", "between": ["frame.A", "motor.O"]}, {"name": "B", "type": "revolute", "between": ["frame.B", "drum.O"]},
                  {"name": "G", "type": "gear", "between": ["motor.O", "drum.O"], "teeth": [40, 20]}],
        "coordinate": [{"joint": "A", "motion": {"law": "polynomial-345", "from": 0, "to": 10, "duration": 2}}],
        "actuator": [{"joint": "A"}], "time": {"end": 2, "samples": 6001},
        "stop": [{"name": "end", "joint": "B", "min": -15, "restitution": 0.3}],
    }  # fmt: skip
    told = told_alike(scene, tmp_path)
    assert any(line.startswith("  end stops        passed: 'end.min' of joint 'B' by ") for line in told), told


@pytest.mark.parametrize("stroke", [(0.6, 1.1), (1.1, 0.6)])
def test_cylinders_beyond_what_they_can_are_told(tmp_path, stroke):
    """Above the supply and beyond the stroke: samples, the worst instant, what is asked for and what is there."""
    drives = [{"joint": "ram", "cylinder": RAM | {"stroke": [*stroke]}}]
    scene = linkdyn.Scene({**LIFT, "actuator": drives})
    motion = scene.inverse()
    found = motion.linkdyn.cylinder("ram")
    pressure = np.maximum(found.head_pressure, found.rod_pressure).values
    supply = 52e5 if stroke[0] < stroke[1] else 83e5
    drives[0]["cylinder"]["supply"] = supply
    told = told_alike({**LIFT, "actuator": drives}, tmp_path)
    above = pressure > supply
    line = next(line for line in told if line.startswith("  above supply"))
    assert 0 < above.sum() < 201
    assert line.startswith(f"  above supply     cylinder at 'ram' in {above.sum()} samples, first at t = ")
    assert f"most at t = {motion.time.values[pressure.argmax()]:.6g}" in line and f": {pressure.max() / 1e5:.4f}"[:8] in line
    assert line.endswith(f" bar required, {supply / 1e5:.4f} bar available")
    q = motion.q.values[:, 0]
    line = next(line for line in told if line.startswith("  beyond stroke"))
    assert line.startswith(f"  beyond stroke    cylinder at 'ram' in {((q < 0.6) | (q > 1.1 + 1e-9)).sum()} samples, first at t = 0 s, most at t = 0 s: ")
    assert line.endswith("0.500000 m required, 0.600000 m to 1.10000 m available")


def test_cylinders_that_can_are_not_told(tmp_path):
    scene = {**LIFT, "actuator": [{"joint": "ram", "cylinder": RAM | {"stroke": [0.5, 1.15], "supply": "100 bar"}}]}
    assert not any(line.startswith(("  above supply", "  beyond stroke")) for line in told_alike(scene, tmp_path))

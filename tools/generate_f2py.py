"""Run f2py on the flat interface and stop the build where f2py would guess.

Usage: generate_f2py.py MODULE OUTDIR SOURCE...

f2py maps every real kind it does not know to C float and says so only in its log; the wrapped
procedure would then read half of each number.
"""

import subprocess
import sys

GUESSES = ("is mapped to C", "No C-type found", "mapped to C \"float\"")


def main(module: str, outdir: str, *sources: str) -> None:
    command = [sys.executable, "-m", "numpy.f2py", *sources, "-m", module, "--lower", "--build-dir", outdir]
    run = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    guessed = [line.strip() for line in run.stdout.splitlines() if any(text in line for text in GUESSES)]
    if run.returncode != 0:
        sys.exit(f"{run.stdout}\nf2py failed on {' '.join(sources)}")
    if guessed:
        sys.exit(f"{' '.join(sources)}: f2py does not know these kinds; use c_double and c_int:\n" + "\n".join(guessed))


if __name__ == "__main__":
    main(*sys.argv[1:])

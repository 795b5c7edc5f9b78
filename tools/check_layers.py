"""Check the `use` lines of the Fortran sources against the order of the layers, and that what they name, and what is public, is used.

Usage: check_layers.py [ROOT]

Prints one line per violation; exit status 1 if there is any. A layer is a folder of fortran/ (and
app/). It may use the layers below it and itself; libraries and the command line are named only
in the few files that exist to hide them.
"""

import re
import sys
from fnmatch import fnmatch
from pathlib import Path

RECORDED = ["joints", "bodies", "groups", "forces", "equations", "quantities", "programs"]   # physics written with values
ORDER = ["kinds", "core", "record", "geometry", "lanes", "linalg", "kinematics", "model", "files", *RECORDED,
         "measures", "assembly", "analysis", "inverse", "forward", "sweep", "explain", "generate", "scene_file", "output"]
MAY_USE = {layer: set(ORDER[: i + 1]) for i, layer in enumerate(ORDER)}
for layer in RECORDED:
    MAY_USE[layer] -= {"lanes", "linalg", "kinematics"}
MAY_USE["lecture"] = {"kinds", "core", "lanes", "kinematics", "lecture"}                # stands alone
MAY_USE["integrate"] = {"kinds", "core", "lanes", "linalg", "integrate"}   # knows a right-hand side, never a body
for layer in ORDER[ORDER.index("analysis"):]:
    MAY_USE[layer] |= {"integrate"}
MAY_USE["api"] = set(ORDER) | {"integrate", "lecture", "api"}
MAY_USE["app"] = set(ORDER) | {"integrate", "app"}

# What only the named files may mention: (what, pattern in the code, files)
WIDTH = 132
"""Of a line of Fortran, comments among it."""

RESERVED = [
    ("the netCDF library", r"^\s*use\s*(?:,\s*non_intrinsic\s*::)?\s*netcdf\b", ["output/linkdyn_netcdf*.f90"]),
    ("C kinds", r"\biso_c_binding\b",
     ["core/linkdyn_code.f90", "core/linkdyn_interrupt.f90", "core/linkdyn_hash.f90", "core/linkdyn_progress_line.f90", "core/linkdyn_threads.f90",
      "kinds/linkdyn_multiply_add_real64.f90", "record/linkdyn_block_real64.f90", "record/linkdyn_record.f90",
      "files/linkdyn_child.f90", "files/linkdyn_file_lock.f90", "files/linkdyn_path.f90",
      "files/linkdyn_toml.f90", "files/linkdyn_input.f90", "files/linkdyn_spool.f90", "files/linkdyn_output_file.f90",
      "integrate/linkdyn_ode_gsl.f90", "api/*.f90"]),
    ("real kinds", r"\b(?:real32|real64|real128|double\s+precision)\b|\d[de][+-]?\d+(?!_wp|\d)\b",
     ["kinds/*.f90", "output/linkdyn_netcdf*.f90", "scene_file/linkdyn_scene_links.f90",                  # a file's numbers are real64
      "record/linkdyn_folding.f90", "record/linkdyn_operation.f90", "record/linkdyn_record.f90"]),   # constants fold in quadruple
    ("LAPACK", r"\bcall\s+[sd](?:ge|gb|po|sy|tr|or)[a-z]{2,4}\b", ["linalg/linkdyn_dense_lapack.f90"]),
    ("GSL", r"\bgsl_\w+", ["integrate/linkdyn_ode_gsl.f90"]),
    ("the command line", r"\b(?:get_command_argument|get_command|command_argument_count)\b", ["app/*.f90"]),
    ("stop", r"^\s*(?:error\s+)?stop\b", ["app/*.f90"]),
]
MODULE = re.compile(r"^\s*module\s+(?!procedure\b|subroutine\b|function\b)(\w+)\s*$", re.I | re.M)
USES = re.compile(r"^\s*use\b(?:\s*,\s*non_intrinsic)?\s*(?:::)?\s*(\w+)", re.I | re.M)
BINDS = re.compile(r"\bbind\s*\(\s*c\s*,\s*name\s*=\s*[\"'](\w+)[\"']", re.I)
SUBMODULE = re.compile(r"^\s*submodule\s*\(\s*(\w+)", re.I | re.M)
PUBLIC = re.compile(r"^\s*public\s*::\s*([^\n]*)$", re.I | re.M)
IMPORTS = re.compile(r"^\s*use\b[^\n:]*?(?:::\s*)?(\w+)\s*,\s*only\s*:([^\n]*)$", re.M)


def code_of(text: str) -> str:
    """The source without strings and comments, in lower case."""
    text = re.sub(r"\"[^\"\n]*\"|'[^'\n]*'", '""', text)
    return re.sub(r"!.*", "", text).lower()


def idle_imports(text: str) -> list[str]:
    """Names of `use` lines that occur nowhere else in the source; of operators those with a name of their own."""
    text = re.sub(r"\"[^\"\n]*\"|'[^'\n]*'", '""', text).lower()
    code = re.sub(r"&\s*(?:![^\n]*)?\n", " ", re.sub(r"!(?!\$)[^\n]*", "", text))     # OpenMP names things, too
    rest = IMPORTS.sub("", code)
    idle = []
    for module, names in IMPORTS.findall(code):
        for name in (name.split("=>")[0].strip() for name in names.split(",") if name.strip()):
            word = name.removeprefix("operator(").removesuffix(")") if name.startswith("operator(.") else name
            if word.startswith(("operator", "assignment")):
                continue
            found = word in rest if word.startswith(".") else re.search(rf"(?:\b|(?<=[\d.]_)){word}\b", rest)     # 1.0_wp
            if not found:
                idle.append(f"{name} of {module}")
    return idle


def read_sources(root: Path) -> dict[str, tuple[str, str]]:
    """layer and text of each source, by its name `layer/file.f90`."""
    sources = {}
    for path in sorted([*(root / "fortran").glob("*/*.f90*"), *(root / "app").glob("*.f90*")]):
        layer = path.parent.name
        sources[f"{layer}/{path.name.removesuffix('.in')}"] = layer, path.read_text(encoding="utf-8")
    return sources


def idle_publics(root: Path, sources: dict[str, tuple[str, str]]) -> list[str]:
    """Public procedures and types that no other file knows. Constants stand in families, and layers for other languages end here."""
    others = [path.read_text(encoding="utf-8") for folder in ("tests", "benchmarks") for path in sorted((root / folder).rglob("*.f90*"))]
    code = {file: code_of(text) for file, (layer, text) in sources.items() if layer != "api"}
    known = {file: set(re.findall(r"\w+", text)) for file, text in code.items()}
    elsewhere = set().union(*(re.findall(r"\w+", code_of(text)) for text in [*others, *(t for l, t in sources.values() if l == "api")]))
    idle = []
    for file, text in code.items():
        joined = re.sub(r"&\s*\n\s*", "", text)
        constants = set(re.findall(r"\w+", " ".join(re.findall(r"^\s*[^\n:]*\bparameter\b[^\n:]*::([^\n]*)", joined, re.M))))
        names = {name.strip() for line in PUBLIC.findall(joined) for name in line.split(",")} - constants - elsewhere
        for name in sorted(name for name in names if re.fullmatch(r"\w+", name)):
            if not any(name in words for other, words in known.items() if other != file):
                idle.append(f"{file}: {name} is public, and nobody else knows it")
    return idle


def find_violations(root: Path) -> list[str]:
    """One line for each `use` or mention that breaks the order of the layers, and for each public name that nobody uses."""
    sources = read_sources(root)
    layer_of = {name: layer for layer, text in sources.values() for name in MODULE.findall(code_of(text))}
    violations = idle_publics(root, sources)
    for file, (layer, text) in sources.items():
        code = code_of(text)
        if layer not in MAY_USE:
            violations.append(f"{file}: '{layer}' is not a layer")
            continue
        for name in sorted({*USES.findall(code), *SUBMODULE.findall(code)}):
            if name in layer_of and layer_of[name] not in MAY_USE[layer]:
                violations.append(f"{file}: uses {name}, but {layer} lies below {layer_of[name]}")
            elif name not in layer_of and name.startswith("linkdyn_"):
                violations.append(f"{file}: uses {name}, which no source defines")
        for what, pattern, allowed in RESERVED:
            if re.search(pattern, code, re.M) and not any(fnmatch(file, form) for form in allowed):
                violations.append(f"{file}: names {what}; only {', '.join(allowed)} may")
        violations += [f"{file}: uses {name} nowhere" for name in idle_imports(text) if "include" not in code]
        for name in {name.lower() for name in BINDS.findall(text)} & layer_of.keys():
            violations.append(f"{file}: binds {name}, the name of a module: gfortran takes one for the other")
        violations += [f"{file}:{number}: longer than {WIDTH} columns" for number, line in enumerate(text.splitlines(), 1) if len(line) > WIDTH]
        modules = MODULE.findall(code)
        stem = Path(file).stem
        if layer not in ("kinds", "app") and len(modules) > 1:
            violations.append(f"{file}: more than one module")
        twins = ("_lapack", "_builtin", "_absent", "_real64", "_real128", "_serial", "_mpi")
        if modules and stem.removesuffix(next((end for end in twins if stem.endswith(end)), "")) != modules[0]:
            violations.append(f"{file}: holds module {modules[0]}")
    return violations


def main(root: str = str(Path(__file__).resolve().parent.parent)) -> int:
    violations = find_violations(Path(root))
    print("\n".join(violations) if violations else "the layers are in order")
    return 1 if violations else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

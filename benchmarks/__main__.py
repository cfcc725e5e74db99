"""Run every benchmark module that times something, or those that are named."""

import importlib
import pkgutil
import sys

import benchmarks


def run(names):
    known = sorted(m.name for m in pkgutil.iter_modules(benchmarks.__path__) if not m.name.startswith("_"))
    unknown = sorted(set(names) - set(known))
    if unknown:
        print(f"unknown: {', '.join(unknown)}; known: {', '.join(known)}", file=sys.stderr)
        return 2
    for name in names or known:
        module = importlib.import_module(f"benchmarks.{name}")
        # What breaks things by the thousand is run where it is asked for
        if names or not getattr(module, "ON_REQUEST", False):
            print(f"== {name}")
            module.main()
    return 0


if __name__ == "__main__":
    sys.exit(run(sys.argv[1:]))

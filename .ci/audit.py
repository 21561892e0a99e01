"""Look every dependency of constraints.txt up in a database of known vulnerabilities: ``make audit``.

usage: audit.py PIP_AUDIT CONSTRAINTS. Exit code 0: all were looked up and nothing is known; 1: something is; 2: not all
could be looked up. pip-audit itself ends well when it has found none of them in the database.
"""

import json
import subprocess
import sys


def main(pip_audit: str, constraints: str) -> int:
    """Run it and judge what it says."""
    command = [pip_audit, "--requirement", constraints, "--no-deps", "--disable-pip", "--format", "json"]
    done = subprocess.run(command, capture_output=True, text=True)
    try:
        dependencies = json.loads(done.stdout)["dependencies"]
    except (ValueError, KeyError, TypeError):
        last = (done.stderr.strip().splitlines() or ["it said nothing"])[-1]
        return _say(f"the database cannot be reached, nothing was looked up: {last}", 2)
    known = [(one, each) for one in dependencies for each in one.get("vulns", ())]
    for one, each in known:
        fixed = ", ".join(each.get("fix_versions", ())) or "no version"
        print(f"{one['name']} {one['version']}: {each['id']}, mended in {fixed}")
    skipped = [one for one in dependencies if "skip_reason" in one]
    if known:
        return _say(f"{len(known)} known vulnerabilities in {len(dependencies)} dependencies", 1)
    if skipped or not dependencies:
        reason = skipped[0]["skip_reason"] if skipped else "the list is empty"
        return _say(f"{len(skipped)} of {len(dependencies)} dependencies could not be looked up: {reason}", 2)
    return _say(f"{len(dependencies)} dependencies, no known vulnerability", 0)


def _say(line: str, code: int) -> int:
    print(f"audit: {line}")
    return code


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

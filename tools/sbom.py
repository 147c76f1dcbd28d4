"""What the wheel holds of others, as CycloneDX 1.5: its `dist-info/sboms/flightid.cdx.json`.

``python tools/sbom.py --write`` makes sboms/flightid.cdx.json from Cargo.lock and
app/package-lock.json; without the flag it is printed. The same bytes in any folder: a list that
maturin makes by itself names the folder that it was built in, and no packages of the page.
"""

from __future__ import annotations

import argparse
import base64
import gzip
import json
import re
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
PLACE = ROOT / "sboms" / "flightid.cdx.json"
PLOTLY = ROOT / "src/flightid/plot/plotly-cartesian.min.js.gz"
OF_THE_PAGE = ("clsx", "esm-env", "fflate", "svelte", "three", "uplot")
"""Packages with code in page.js or gunzip.js: what app/src imports, and Svelte's client."""
ROOT_CRATE = "flightid-python"
LINKED, BUILT_WITH = "required", "excluded"
"""CycloneDX's words for what is in the wheel, and for what only makes it."""


def document() -> dict[str, Any]:
    """The whole list."""
    version = tomllib.loads((ROOT / "Cargo.toml").read_text("utf-8"))["workspace"]["package"]
    found, needs = _crates()
    page = [*_packages_of_the_page(), _plotly()]
    own = f"pkg:pypi/flightid@{version['version']}"
    (native,) = (each["bom-ref"] for each in found if each["name"] == ROOT_CRATE)
    needs[own] = [native, *(each["bom-ref"] for each in page)]
    components = sorted([*found, *page], key=lambda each: str(each["bom-ref"]))
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {
            "component": {
                "type": "library",
                "bom-ref": own,
                "name": "flightid",
                "version": version["version"],
                "licenses": [{"expression": version["license"]}],
                "purl": own,
            }
        },
        "components": components,
        "dependencies": [
            {"ref": each, "dependsOn": sorted(needs.get(each, []))}
            for each in (own, *(str(each["bom-ref"]) for each in components))
        ],
    }


def _component(purl: str, name: str, version: str, licence: str, **more: object) -> dict[str, Any]:
    return {
        "type": "library",
        "bom-ref": purl,
        "name": name,
        "version": version,
        "scope": LINKED,
        **more,
        "licenses": [{"expression": licence.replace("/", " OR ")}],
        "purl": purl,
    }


def _crates() -> tuple[list[dict[str, Any]], dict[str, list[str]]]:
    """Crates that the native half is linked from or built with, and what each needs."""
    command = ["cargo", "metadata", "--format-version", "1", "--locked"]
    text = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    told = json.loads(text)
    lock = tomllib.loads((ROOT / "Cargo.lock").read_text("utf-8"))["package"]
    sums = {(each["name"], each["version"]): each.get("checksum") for each in lock}
    packages = {each["id"]: each for each in told["packages"]}
    needs = {
        node["id"]: [
            (each["pkg"], any(kind["kind"] is None for kind in each["dep_kinds"]))
            for each in node["deps"]
            if any(kind["kind"] in (None, "build") for kind in each["dep_kinds"])
        ]
        for node in told["resolve"]["nodes"]
    }
    (start,) = (each["id"] for each in told["packages"] if each["name"] == ROOT_CRATE)
    linked: dict[str, bool] = {}
    waiting = [(start, True)]
    while waiting:
        crate, is_linked = waiting.pop()
        is_macro = any("proc-macro" in target["kind"] for target in packages[crate]["targets"])
        is_linked = is_linked and not is_macro
        if crate not in linked or is_linked > linked[crate]:
            linked[crate] = is_linked
            waiting += [(each, is_linked and normal) for each, normal in needs[crate]]
    refs = {
        crate: f"pkg:cargo/{packages[crate]['name']}@{packages[crate]['version']}"
        for crate in linked
    }
    found = []
    for crate, is_linked in linked.items():
        about = packages[crate]
        content = sums[about["name"], about["version"]]
        more: dict[str, object] = {"scope": LINKED if is_linked else BUILT_WITH}
        if content:
            more["hashes"] = [{"alg": "SHA-256", "content": content}]
        name, version = about["name"], about["version"]
        found.append(_component(refs[crate], name, version, about["license"], **more))
    return found, {refs[crate]: [refs[each] for each, _ in needs[crate]] for crate in linked}


def _packages_of_the_page() -> Iterator[dict[str, Any]]:
    lock = json.loads((ROOT / "app" / "package-lock.json").read_text("utf-8"))["packages"]
    for name in OF_THE_PAGE:
        about = lock[f"node_modules/{name}"]
        algorithm, _, text = about["integrity"].partition("-")
        assert algorithm == "sha512", f"{name} is locked by {algorithm}; SHA-512 is written here"
        content = base64.b64decode(text).hex()
        hashes = [{"alg": "SHA-512", "content": content}]
        purl = f"pkg:npm/{name}@{about['version']}"
        yield _component(purl, name, about["version"], about["license"], hashes=hashes)


def _plotly() -> dict[str, Any]:
    """Of the script that reports draw with; its own first lines tell which it is."""
    head = gzip.decompress(PLOTLY.read_bytes())[:200].decode("utf-8")
    (version,) = re.findall(r"plotly\.js \(cartesian - minified\) v([\d.]+)", head)
    return _component(f"pkg:npm/plotly.js@{version}", "plotly.js", version, "MIT")


def text() -> str:
    """As the file holds it."""
    return json.dumps(document(), indent=1) + "\n"


def main() -> None:
    """Print the list or write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"write {PLACE.name}")
    if parser.parse_args().write:
        PLACE.parent.mkdir(exist_ok=True)
        PLACE.write_text(text(), encoding="utf-8")
    else:
        print(text(), end="")


if __name__ == "__main__":
    main()

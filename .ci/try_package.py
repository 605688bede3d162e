"""Tries the installed package away from its checkout; .ci/run gives it the README."""

import re
import sys
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path

import skfem_contact as sc

readme = Path(sys.argv[1])
checkout = readme.resolve().parent
assert checkout not in Path(sc.__file__).resolve().parents, f"imported from {sc.__file__}"
assert version("skfem-contact") == sc.__version__
assert (files("skfem_contact") / "py.typed").is_file()

blocks = re.findall(
    r"^```python\n(.*?)^```$", readme.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
)
code = [
    re.sub(r"^(?:>>>|\.\.\.) ?", "", line)
    for line in "".join(blocks).splitlines()
    if line[:3] in (">>>", "...")
]
names: dict = {}
exec("\n".join(code) if code else "".join(blocks), names)
assert names["result"].converged
print(f"skfem_contact {sc.__version__} from {Path(sc.__file__).parent}: the README's example runs")

"""Write plain values as YAML text that reads back as the same values."""

from __future__ import annotations

import io
import re
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.representer import SafeRepresenter

_WIDTH = 100
"""Column after which lines are broken [characters]."""

_PLAIN = re.compile(r"[^\W\d_](?:[\w./-]| (?=[\w./-]))*")
"""Text that is written without quotes, unless it is a word such as ``true``: YAML can read it as text only."""


class _Representer(SafeRepresenter):
    """Writes text without quotes only if it certainly reads back as text; the library's own rule has exceptions."""

    def represent_str(self, data: str) -> Any:
        """Return the node of a text, in quotes if necessary."""
        plain = _PLAIN.fullmatch(data) and data.lower() not in ("null", "true", "false", "yes", "no", "on", "off")
        return self.represent_scalar("tag:yaml.org,2002:str", data, style="" if plain else '"')


_Representer.add_representer(str, _Representer.represent_str)


def written_document(value: Any) -> str:
    """Return a YAML document that :func:`crowdsim.yamlfile.document.read_document` reads as ``value``.

    ``value`` is made of dictionaries, lists, text, numbers, booleans and None; keys keep their order.
    """
    yaml = YAML(typ="safe", pure=True)
    yaml.Representer = _Representer
    yaml.default_flow_style = None  # lists and mappings of scalars alone stand on one line
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    yaml.width = _WIDTH
    yaml.allow_unicode = True
    text = io.StringIO()
    yaml.dump(value, text)
    return text.getvalue()

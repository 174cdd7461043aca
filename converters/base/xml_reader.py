"""Untrusted XML: tolerant of what is harmless, closed to what is not.

Accepted, since real URDFs have it: a byte-order mark, blanks or text before `<?xml` or after the root, any version
number, a wrong or missing encoding declaration, unbound namespace prefixes, a bare `&`, double hyphens in comments.
Names are compared without the namespace of the root element; elements of other namespaces keep theirs.
Refused with an `InputError`: entity declarations (so nothing can expand, and no file or address is fetched),
truncated or ill-nested files, files that are no XML, and files over a limit (`ReadLimits`). All of it takes time in
proportion to the file.
"""

from __future__ import annotations

import os
import pathlib
import re
from typing import Any

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]  it has no stubs

from ig2mj.errors import InputError

from . import inputs
from .read_limits import check_limit
from .text import LFS_FIX, LFS_POINTER, marked_encoding

MAX_NUMBER = 1e15  # beyond, products of a few numbers are no numbers any more
ENCODINGS = re.compile(
    r"utf-?8|(us-)?ascii|latin-?1|iso-?8859-\d+|(windows-|cp)125\d|koi8-[ru]"
    r"|gbk?|gb2312|gb18030|big5|shift-jis|euc-(jp|kr)"
)
"""Declared encodings that are followed; all decode in linear time, as punycode or idna do not."""
QUOTED = 120
"""Characters of a name that a message quotes at most."""
Element = Any  # lxml.etree._Element, for which there are no type stubs

# libxml2 goes quiet after its first syntax error, so only errors that leave it talking may be let pass.
_HARMLESS = {
    "NS_ERR_UNDEFINED_NAMESPACE",
    "NS_ERR_ATTRIBUTE_REDEFINED",
    "ERR_DOCUMENT_END",
    "WAR_NS_URI",
    "WAR_NS_URI_RELATIVE",
}
_DECLARATION = re.compile(r"\A\s*<\?xml\b[^>]*\?>")
_ENCODING = re.compile(rb"<\?xml[^>]*\bencoding\s*=\s*[\"']([A-Za-z0-9._-]+)[\"']")
_OPENING = re.compile(r"<!--|<!\[CDATA\[")
_BARE_AMPERSAND = re.compile(r"&(?!#\d+;|#x[0-9A-Fa-f]+;|(?:amp|lt|gt|quot|apos);)")
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?\Z")


def read_bytes(file: str | os.PathLike, limit: int | str) -> bytes:
    """A regular file's bytes. Raises InputError: missing, no regular file, unreadable, over the limit.

    limit: bytes, or the name of one of `ReadLimits`.
    """
    path = pathlib.Path(file)
    try:
        if not inputs.is_file(path):
            raise InputError(file, "is a folder or a device" if path.exists() else "does not exist")
        size = path.stat().st_size
        if isinstance(limit, str):
            check_limit(limit, size, file, "bytes")
        elif size > limit:
            raise InputError(file, f"has {size} bytes, more than the limit of {limit}")
        return inputs.content(path)
    except OSError as e:
        raise InputError(file, f"cannot be read: {e.strerror or e}") from e
    except ValueError as e:  # a null byte in the name
        raise InputError(repr(str(file)), f"is not a file name: {e}") from e


def decode_xml(raw: bytes, file: object) -> str:
    """Bytes -> text without byte-order mark, declaration and comments (line numbers are kept). Raises InputError."""
    text = _decoded(raw)
    start = text.find("<")
    if start < 0:
        fix = LFS_FIX if raw.startswith(LFS_POINTER) else ""
        raise InputError(file, "is not XML: it holds no '<'" if text.strip("\0 \r\n\t") else "is empty", fix=fix)
    if start:
        text = "\n" * text.count("\n", 0, start) + text[start:]
    text = _DECLARATION.sub(_only_newlines, text, count=1)
    text = _without_comments(text, file)
    if "<!ENTITY" in text:
        raise InputError(file, "declares XML entities, which are refused", fix="replace the entities by their text")
    check_limit("xml_elements", text.count("<") // 2 + text.count("="), file, "elements and attributes")
    return text


def _decoded(raw: bytes) -> str:
    """Text by the byte-order mark, else by the declared encoding, else UTF-8; Latin-1 where that does not fit."""
    if (marked := marked_encoding(raw)) is not None:
        encoding, skip = marked
        return raw[skip:].decode(encoding, errors="replace")
    match = _ENCODING.search(raw[:400])
    encoding = "utf-8" if match is None else match[1].decode("ascii").lower().replace("_", "-")
    if not ENCODINGS.fullmatch(encoding):
        return raw.decode("utf-8", errors="replace")
    try:
        return raw.decode(encoding)
    except (LookupError, UnicodeError):
        return raw.decode("latin-1")


def _without_comments(text: str, file: object) -> str:
    """Comments replaced by their line breaks, in one pass; what stands in CDATA is text."""
    kept, at = [], 0
    while (opening := _OPENING.search(text, at)) is not None:
        comment = opening[0] == "<!--"
        end = text.find("-->" if comment else "]]>", opening.end())
        if end < 0:
            line = f"line {text.count(chr(10), 0, opening.start()) + 1}"
            what = "a comment" if comment else "a CDATA section"
            raise InputError(file, f"is broken or truncated XML: {what} does not end", element=line)
        end += 3
        kept += [text[at : opening.start()], "\n" * text.count("\n", opening.start(), end) if comment else
                 text[opening.start() : end]]  # fmt: skip
        at = end
    return "".join([*kept, text[at:]]) if kept else text


def _only_newlines(match: re.Match[str]) -> str:
    return "\n" * match[0].count("\n")


def read_xml(
    file: str | os.PathLike,
    root_tag: str | tuple[str, ...],
    warnings: list[str] | None = None,
    limit: int | None = None,
) -> Element:
    """Parses a file into an lxml element.

    Args:
      root_tag: what the root element must be called.
      warnings: gets a line for each oddity that was accepted with loss.
      limit: most bytes; default the limit `xml_bytes`.

    Raises:
      InputError: see the module's text.
    """
    raw = read_bytes(file, "xml_bytes" if limit is None else limit)
    text = _BARE_AMPERSAND.sub("&amp;", decode_xml(raw, file)).replace("\0", "\ufffd")
    del raw
    parser = etree.XMLParser(
        encoding="utf-8",
        recover=True,
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        huge_tree=False,
        remove_comments=True,
        remove_pis=True,
    )
    try:
        root = etree.fromstring(text.encode("utf-8", errors="replace"), parser)
    except etree.XMLSyntaxError as e:
        raise InputError(file, f"is not XML: {e.msg}", element=f"line {e.lineno}") from e
    for entry in parser.error_log:
        if entry.type_name not in _HARMLESS:
            raise InputError(file, f"is broken or truncated XML: {entry.message}", element=f"line {entry.line}")
        if entry.type_name == "ERR_DOCUMENT_END" and warnings is not None:
            warnings.append(f"content after the root element (line {entry.line}) was ignored")
    tags = (root_tag,) if isinstance(root_tag, str) else root_tag
    if root is None:
        raise InputError(file, "is not XML: it has no root element")
    strip_namespace(root)
    if local_name(root) not in tags:
        raise InputError(file, f"the root element is <{local_name(root)}>, not <{tags[0]}>", element=where(root))
    return root


def strip_namespace(root: Element) -> None:
    """Takes the namespace of the root (declared, or an unbound prefix) and default namespaces off all names."""
    own = etree.QName(root).namespace if "}" in root.tag else None
    prefix = f"{root.tag.partition(':')[0]}:" if own is None and ":" in root.tag else None
    for element in root.iter(etree.Element):
        if "}" in element.tag:
            if element.prefix is None or etree.QName(element).namespace == own:
                element.tag = etree.QName(element).localname
        elif prefix is not None:
            element.tag = element.tag.removeprefix(prefix)
        if own is not None:
            for name in [n for n in element.attrib if n.startswith(f"{{{own}}}")]:
                value, plain = element.attrib.pop(name), name.partition("}")[2]
                if plain not in element.attrib:
                    element.set(plain, value)


def parse_strictly(text: str, file: object) -> Element:
    """The root element of well-formed XML that `decode_xml` returned, text of any length. Raises InputError."""
    parser = etree.XMLParser(
        encoding="utf-8", resolve_entities=False, no_network=True, load_dtd=False, huge_tree=True, remove_pis=True
    )
    try:
        return etree.fromstring(text.encode("utf-8", errors="replace"), parser)
    except etree.XMLSyntaxError as e:
        raise InputError(file, f"is broken or truncated XML: {e.msg}", element=f"line {e.lineno}") from e


def local_name(element: Element) -> str:
    """Tag without its namespace."""
    return etree.QName(element).localname if "}" in element.tag else element.tag


def where(element: Element) -> str:
    """How an error message names an element: "link 'door' collision origin (line 12)"."""
    names = []
    node = element
    while node is not None:
        name = node.get("name")
        names.append(f"{local_name(node)} '{shortened(name)}'" if name is not None else local_name(node))
        if name is not None or node.getparent() is None or node.getparent().getparent() is None:
            break
        node = node.getparent()
    return f"{' '.join(reversed(names))} (line {element.sourceline})"


def parse_number(word: str) -> float | None:
    """A decimal number below `MAX_NUMBER`, or None (float() would take "nan", "1_000" and digits of other scripts)."""
    if not _NUMBER.match(word):
        return None
    value = float(word)
    return value if abs(value) <= MAX_NUMBER else None


def is_huge(word: str) -> bool:
    """Whether it is a decimal number beyond `MAX_NUMBER`."""
    return bool(_NUMBER.match(word)) and abs(float(word)) > MAX_NUMBER


def numbers(
    element: Element, attribute: str, count: int, file: object, default: tuple[float, ...] | None = None
) -> np.ndarray:
    """An attribute of `count` finite numbers separated by blanks, [count].

    Args:
      default: where the attribute is absent; None: absence is an error.

    Raises:
      InputError: absent, not `count` words, or a word that is not a finite number.
    """
    text = element.get(attribute)
    if text is None:
        if default is None:
            raise InputError(file, f"attribute '{attribute}' is missing", element=where(element))
        return np.array(default, dtype=float)
    words = [word.removesuffix(",") for word in text.split()]  # "0.1, 0, 0" is common, and harmless
    fix = "expand the file with xacro" if "${" in text or "$(" in text else ""
    if len(words) != count:
        raise InputError(
            file,
            f"{attribute}='{shortened(text, 40)}' has {len(words)} numbers instead of {count}",
            element=where(element),
            fix=fix,
        )
    values = [parse_number(w) for w in words]
    for word, value in zip(words, values, strict=True):
        if value is None:
            raise InputError(
                file, f"{attribute}: '{shortened(word, 40)}' is not a finite number", element=where(element), fix=fix
            )
    return np.array(values, dtype=float)


def number(element: Element, attribute: str, file: object, default: float | None = None) -> float:
    """An attribute of one finite number; see `numbers`."""
    return float(numbers(element, attribute, 1, file, None if default is None else (default,))[0])


def shortened(text: str, most: int = QUOTED) -> str:
    """A text to be quoted in a message, of at most so many characters."""
    return text if len(text) <= most else text[: most - 3] + "..."

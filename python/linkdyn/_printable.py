"""Texts of strangers on a terminal."""

from __future__ import annotations

__all__ = ["printable"]

_UNSEEN = {chr(code) for first, last in ((0x200B, 0x200F), (0x2028, 0x202E), (0x2060, 0x206F), (0xFEFF, 0xFEFF)) for code in range(first, last + 1)}


def printable(text: str, has_lines: bool = False) -> str:
    """A text as a terminal may have it: control characters, which could move its cursor or rename its window, and bytes that are no UTF-8 become
    visible, ``\\x1B``, as in what the executable says. Line ends stay if the text may have several lines."""
    return "".join(_visible(letter) if _commands(letter) and not (has_lines and letter == "\n") else letter for letter in text)


def _commands(letter: str) -> bool:
    """Both sets of control characters, what nobody sees (it turns the direction of what follows, has no width, or ends a line), and halves of characters,
    which stand for bytes of file names."""
    return letter < " " or "\x7f" <= letter <= "\x9f" or "\ud800" <= letter <= "\udfff" or letter in _UNSEEN


def _visible(letter: str) -> str:
    errors = "surrogateescape" if "\udc80" <= letter <= "\udcff" else "surrogatepass"
    return "".join(f"\\x{byte:02X}" for byte in letter.encode("utf-8", errors))

"""What a person has typed of a part, and why it cannot be taken."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.service.pages.people import MOST_WHO

MOST_TEXT, MOST_NOTE = 200, 1000
MOST = (MOST_TEXT, MOST_WHO, MOST_NOTE)
"""Characters of a serial, a name and a note."""


@dataclass(frozen=True)
class Said:
    """What a person has typed.

    Attributes:
        text: serial.
        who: name.
        note: anything else.
    """

    text: str
    who: str
    note: str

    @classmethod
    def of(cls, text: str, who: str, note: str) -> Said:
        """As typed, without blanks that mean nothing."""
        return cls(text.strip(), " ".join(who.split()), " ".join(note.split()))

    def fault(self, action: str) -> str:
        """Why it cannot be taken, in words; empty if it can."""
        if action not in ("save", "unreadable"):
            return "Say what is to be done: confirm, or unreadable."
        if not self.who:
            return "Type your name first: it is kept with every review."
        if action == "save" and not self.text:
            return "Type the serial, or say that it cannot be read (Alt+U)."
        for name, value, most in (
            ("serial", self.text, MOST_TEXT), ("name", self.who, MOST_WHO), ("note", self.note, MOST_NOTE),
        ):  # fmt: skip
            if len(value) > most:
                return f"The {name} has {len(value)} characters; at most {most} are kept. Shorten it."
            if not value.isprintable():
                return f"The {name} holds characters that cannot be printed. Type it again."
        return ""

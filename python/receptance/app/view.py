"""What a view has, and what it needs of its page."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from bokeh.models import LayoutDOM

from receptance.session.state import Session


class View(Protocol):
    """A view of a page."""

    title: str
    """Name of its tab."""
    layout: LayoutDOM


class PageOfView(Protocol):
    """What a view needs of its page."""

    session: Session
    query: dict[str, str]
    """State in the address."""

    @property
    def shown(self) -> str:
        """Name of the view that is open, as in the address."""

    def when_shown(self, view: str, call: Callable[[], None]) -> None:
        """Call a function when a view is opened."""

    def say(self, text: str) -> None:
        """Show a line of text below the header."""

    def remember(self, **state: str) -> None:
        """Keep state in the address; empty values are left out."""

    def turn_to(self, view: str) -> None:
        """Show another view by its name."""

    def later(self, call: Callable[[], Any], milliseconds: int = 0) -> None:
        """Call a function in the next turn of the server's loop, or after a time; threads may call this."""

"""The page of a cockpit in Chromium, and what the tests do with it."""

from __future__ import annotations

from testcases.browser.conftest import Browser
from testcases.cockpit_rig import TOKEN


class CockpitPage(Browser):
    """A browser with the page of a cockpit."""

    def enter(self, cockpit) -> None:
        """Open the page with the token; the console is read from here on."""
        self.view(1440, 900, "light")
        self.driver.get("about:blank")
        self.complaints()
        self.requests()
        self.driver.get(f"{cockpit.origin}/#token={TOKEN}")
        self.until(
            lambda: self.js("return document.documentElement.dataset.bench") == "up", "the bench comes up"
        )

    def operate(self) -> None:
        """Take control, and bring the bench up afresh."""
        self.take()
        self.show("bench")
        self.press("Reset bench")
        self.until(lambda: self.clock() < 3.0, "reset")

    def take(self) -> None:
        """Take control, if another page has not got it."""
        if "You have control" not in self.one(".control-state").text:
            self.press("Take control", "header")
        self.until(lambda: "You have control" in self.one(".control-state").text, "control")

    def clock(self) -> float:
        """Return bench time, s."""
        return float(self.one(".clock").text.split()[0])

    def press(self, words: str, within: str = "body") -> None:
        """Click the button with these words, when it can be."""
        button = self.until(
            lambda: next(
                (one for one in self.all(f"{within} button") if one.text == words and one.is_enabled()), None
            ),
            f"no button {words}",
        )
        self.js("arguments[0].scrollIntoView({block: 'center'}); arguments[0].click()", button)

    def show(self, view: str) -> None:
        self.js("arguments[0].click()", self.one(f"#tab-{view}"))

    def enable(self) -> None:
        """Enable the axis with the buttons that a person uses."""
        self.show("axis")
        self.press("Enable", "#view-axis")
        self.until(lambda: self.one("#view-axis .badge").text == "standstill", "enabled")

    def far(self) -> None:
        """Begin a move that takes longer than a busy machine needs to see it."""
        self.js("arguments[0].value = 400", self.one('[aria-label="Target or distance"]'))
        self.press("By distance")

    def reading(self, name: str) -> float:
        """Return a value of the axis as it is shown."""
        shown = self.one(f'#view-axis output[aria-label="{name}"]').text
        return float(shown.replace("\u2212", "-"))

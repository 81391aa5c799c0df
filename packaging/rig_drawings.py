"""Drawings of the rig as SVG, from its measures: ``rig_drawings.py [--out DIR] [--screen-width-mm 509.2 …]``.

Three files: ``rig-plan.svg`` (the screen from the front, to scale), ``rig-bracket.svg`` (one of the two holders of the
fibre heads, to scale) and ``rig-wiring.svg``. docs/rig.md shows those of the measures below; a test keeps them current.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, fields
from html import escape
from math import cos, pi
from pathlib import Path

INK, GREY, PALE, BEAM, STYLUS, GREEN = "#222222", "#5b636b", "#f4f6f8", "#d55e00", "#e69f00", "#2e7d32"
HEAD = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {} {}" font-family="DejaVu Sans, Verdana, sans-serif"'


@dataclass(frozen=True)
class Rig:
    """Measures of screen, stylus and holder, in mm. The screen's are those of the paper's Screen 1."""

    screen_width_mm: float = 509.2
    screen_height_mm: float = 286.4
    bezel_mm: float = 22.0  # from the touch area's edge to the outer edge of the frame; measure yours
    bezel_step_mm: float = 0.0  # how far the frame stands above the glass
    stylus_diameter_mm: float = 7.0
    above_widest_mm: float = 0.5  # room for a tip that is worn or pressed flat
    head_thread_mm: float = 4.0  # of the fibre head: data sheet of the fibre unit
    clearance_mm: float = 0.2  # of holes for that thread
    nut_mm: float = 7.0  # across flats, one of which lies towards the frame: M4, ISO 4032
    adjust_mm: float = 3.0  # the slot lets the head move up by so much
    wall_mm: float = 4.0
    bracket_width_mm: float = 24.0
    foot_depth_mm: float = 18.0  # lies on the frame, fastened by double-sided tape or a clamp
    circle_radius_share: float = 0.1  # of the screen's width: the preset latency-sweep at low speeds

    @property
    def beam_height_mm(self) -> float:
        """Above the glass: a round tip has its full diameter from its radius upwards."""
        return self.stylus_diameter_mm / 2 + self.above_widest_mm

    @property
    def hole_height_mm(self) -> float:
        """The beam's height above the frame, on which the holder stands."""
        return self.beam_height_mm - self.bezel_step_mm

    @property
    def slot_mm(self) -> tuple[float, float]:
        """Width and height of the slot for the fibre head; it is open at the bottom."""
        width = self.head_thread_mm + self.clearance_mm
        return width, self.hole_height_mm + self.adjust_mm + width / 2

    @property
    def groove_mm(self) -> float:
        """Width of the groove in the foot, in which the rear nut and the fibre have room."""
        return self.nut_mm / cos(pi / 6) + 2 * self.clearance_mm

    @property
    def bracket_height_mm(self) -> float:
        """The upright's: the slot with a wall above it."""
        return self.slot_mm[1] + self.wall_mm

    @property
    def span_mm(self) -> float:
        """From head to head: each holder stands behind the frame's inner edge with its wall's face above it."""
        return self.screen_width_mm + 2 * (self.bezel_mm - self.foot_depth_mm)

    def problem(self) -> str:
        """Why such a rig cannot be built; empty where it can."""
        if min(getattr(self, one.name) for one in fields(self) if one.name != "bezel_step_mm") <= 0:
            return "each measure must be above zero"
        if self.foot_depth_mm > self.bezel_mm:
            return "the holder's foot is deeper than the frame is wide: it would stand on the touch area"
        if self.groove_mm + 2 * self.wall_mm > self.bracket_width_mm:
            return (
                "the holder is too narrow for the groove with a wall on either side: choose a larger bracket_width_mm"
            )
        if self.hole_height_mm < self.nut_mm / 2:
            return (
                "the nut of the fibre head would touch the frame: choose a larger above_widest_mm, and give the "
                "program the stylus' diameter at that height"
            )
        return ""


def number(value: float) -> str:
    """A coordinate or a measure, without digits that nobody needs."""
    return f"{value:.1f}".rstrip("0").rstrip(".")


def line(x1: float, y1: float, x2: float, y2: float, colour: str = INK, width: float = 1.5, more: str = "") -> str:
    """A straight line."""
    ends = f'x1="{number(x1)}" y1="{number(y1)}" x2="{number(x2)}" y2="{number(y2)}"'
    return f'<line {ends} stroke="{colour}" stroke-width="{number(width)}" {more}/>'


def box(x: float, y: float, width: float, height: float, fill: str = PALE, round_: float = 0) -> str:
    """A rectangle with a rim."""
    place = f'x="{number(x)}" y="{number(y)}" width="{number(width)}" height="{number(height)}" rx="{number(round_)}"'
    return f'<rect {place} fill="{fill}" stroke="{GREY}" stroke-width="1.5"/>'


def words(x: float, y: float, text: str, anchor: str = "middle", size: float = 13, colour: str = INK) -> str:
    """One line of text."""
    place = f'x="{number(x)}" y="{number(y)}" text-anchor="{anchor}" font-size="{number(size)}"'
    return f'<text {place} fill="{colour}">{escape(text)}</text>'


def across(x1: float, x2: float, y: float, text: str) -> str:
    """A measure between two x, with ticks at its ends."""
    ticks = line(x1, y - 5, x1, y + 5, GREY, 1) + line(x2, y - 5, x2, y + 5, GREY, 1)
    return ticks + line(x1, y, x2, y, GREY, 1) + words((x1 + x2) / 2, y - 6, text)


def upwards(x: float, y1: float, y2: float, text: str) -> str:
    """A measure between two y, with ticks at its ends and its text on the right."""
    ticks = line(x - 5, y1, x + 5, y1, GREY, 1) + line(x - 5, y2, x + 5, y2, GREY, 1)
    return ticks + line(x, y1, x, y2, GREY, 1) + words(x + 9, (y1 + y2) / 2 + 5, text, "start")


def svg(width: float, height: float, title: str, parts: list[str]) -> str:
    """The file."""
    begin = HEAD.format(number(width), number(height))
    ground = f'<rect width="{number(width)}" height="{number(height)}" fill="#ffffff"/>'
    return "\n".join([f"{begin}>", f"<title>{escape(title)}</title>", ground, *parts, "</svg>", ""])


def plan(rig: Rig) -> str:
    """The screen from the front with both holders, the beam and a circle, to scale."""
    scale = 700 / (rig.screen_width_mm + 2 * rig.bezel_mm)
    bezel, width, height = scale * rig.bezel_mm, scale * rig.screen_width_mm, scale * rig.screen_height_mm
    left, top = 60 + bezel, 70 + bezel
    middle, right = top + height / 2, left + width
    reach = scale * (rig.span_mm - rig.screen_width_mm) / 2
    holder = scale * rig.bracket_width_mm
    foot = scale * rig.foot_depth_mm
    radius = scale * rig.circle_radius_share * rig.screen_width_mm
    tip = scale * rig.stylus_diameter_mm / 2
    bottom = top + height + bezel
    parts = [
        box(left - bezel, top - bezel, width + 2 * bezel, height + 2 * bezel, "#d9dde2", 6),
        box(left, top, width, height),
        across(left, right, 40, f"touch area {number(rig.screen_width_mm)}"),
        line(left - reach, middle, right + reach, middle, BEAM, 2.5),
        box(left - bezel, middle - holder / 2, foot, holder, INK),
        box(right + bezel - foot, middle - holder / 2, foot, holder, INK),
        f'<circle cx="{number(left + width / 2)}" cy="{number(middle)}" r="{number(radius)}" fill="none" '
        f'stroke="{GREY}" stroke-width="1.5" stroke-dasharray="6 5"/>',
        f'<circle cx="{number(left + width / 2 + radius)}" cy="{number(middle)}" r="{number(tip)}" fill="{STYLUS}"/>',
        words(left + width / 2, middle - radius - 10, "circle of the target; its centre moves along the beam"),
        words(left + 30, middle - 8, "beam", "start", colour=BEAM),
        words(left - bezel, bottom + 24, "emitting fibre", "start"),
        words(right + bezel, bottom + 24, "receiving fibre", "end"),
        across(left - reach, right + reach, bottom + 48, f"head to head {number(rig.span_mm)}"),
        upwards(right + bezel + 12, top, middle, number(rig.screen_height_mm / 2)),
        words(
            60,
            bottom + 74,
            "All measures in mm. The beam need not be level: its slope is estimated.",
            "start",
            12,
            GREY,
        ),
    ]
    return svg(right + bezel + 90, bottom + 90, "The screen from the front, with the holders of the fibre heads", parts)


def bracket(rig: Rig) -> str:
    """One holder from the front, from the side and from above, ten times its size."""
    scale = 10.0
    tall, wide, foot = (scale * one for one in (rig.bracket_height_mm, rig.bracket_width_mm, rig.foot_depth_mm))
    ground, left = 80 + tall, 60.0
    side = left + wide + 190
    note = f"Make two. The slot holds an M{number(rig.head_thread_mm)} fibre head between two nuts; it moves up by"
    groove = "The groove gives room to the rear nut and the fibre."
    parts = [
        *_front(rig, scale, left, ground),
        *_side(rig, scale, side, ground),
        *_above(rig, scale, left, ground + 110),
        words(side - 20, ground + 160, "All measures in mm; ten times its size.", "start", 12, GREY),
        words(side - 20, ground + 180, note, "start", 12, GREY),
        words(side - 20, ground + 200, f"{number(rig.adjust_mm)} mm. {groove}", "start", 12, GREY),
    ]
    return svg(side + foot + 300, ground + 140 + foot, "One of the two holders of the fibre heads", parts)


def _front(rig: Rig, scale: float, left: float, ground: float) -> list[str]:
    """The holder as seen from the screen, with the fibre head in its slot."""
    slot_width, slot_height = (scale * one for one in rig.slot_mm)
    tall, wide = scale * rig.bracket_height_mm, scale * rig.bracket_width_mm
    centre, hole = left + wide / 2, ground - scale * rig.hole_height_mm
    return [
        words(centre, 30, "From the screen", size=15),
        box(left, ground - tall, wide, tall),
        box(centre - slot_width / 2, ground - slot_height, slot_width, slot_height, "#ffffff"),
        f'<circle cx="{number(centre)}" cy="{number(hole)}" r="{number(scale * rig.head_thread_mm / 2)}" '
        f'fill="none" stroke="{BEAM}" stroke-width="2"/>',
        across(left, left + wide, ground + 30, number(rig.bracket_width_mm)),
        across(centre - slot_width / 2, centre + slot_width / 2, ground - tall - 12, number(rig.slot_mm[0])),
        upwards(left + wide + 14, ground - tall, ground, number(rig.bracket_height_mm)),
        upwards(left + wide + 74, hole, ground, f"beam {number(rig.hole_height_mm)}"),
    ]


def _side(rig: Rig, scale: float, left: float, ground: float) -> list[str]:
    """The holder on the frame, with the glass and the beam."""
    tall, wall, foot = (scale * one for one in (rig.bracket_height_mm, rig.wall_mm, rig.foot_depth_mm))
    glass, beam, end = ground + scale * rig.bezel_step_mm, ground - scale * rig.hole_height_mm, left + foot + 150
    return [
        words(left + foot / 2, 30, "From the side; the screen is on the right", size=15),
        box(left, ground - wall, foot, wall),
        box(left + foot - wall, ground - tall, wall, tall),
        line(left - 20, ground, left + foot + 40, ground, GREY, 2),
        line(left + foot + 40, glass, end, glass, GREY, 2),
        line(left + foot, beam, end, beam, BEAM, 2.5),
        words(end, beam - 8, "beam", "end", colour=BEAM),
        words(end, glass + 18, "glass", "end", colour=GREY),
        words(left - 20, ground + 18, "frame", "start", colour=GREY),
        across(left, left + foot, ground + 48, f"foot {number(rig.foot_depth_mm)}"),
        across(left + foot - wall, left + foot, ground - tall - 12, number(rig.wall_mm)),
        upwards(left + foot + 100, beam, glass, f"{number(rig.beam_height_mm)} above the glass"),
    ]


def _above(rig: Rig, scale: float, left: float, top: float) -> list[str]:
    """The foot with its groove; the screen is below."""
    wide, wall, foot, groove = (
        scale * one for one in (rig.bracket_width_mm, rig.wall_mm, rig.foot_depth_mm, rig.groove_mm)
    )
    slot, centre = scale * rig.slot_mm[0], left + wide / 2
    return [
        words(centre, top - 40, "From above; the screen is below", size=15),
        box(left, top, wide, foot),
        box(centre - groove / 2, top, groove, foot - wall, "#ffffff"),
        box(centre - slot / 2, top + foot - wall, slot, wall, "#ffffff"),
        across(centre - groove / 2, centre + groove / 2, top - 8, f"groove {number(rig.groove_mm)}"),
    ]


def wiring() -> str:
    """What is connected to what."""

    def wire(points: str, colour: str = INK, dashes: str = "") -> str:
        return (
            f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2" stroke-dasharray="{dashes}"/>'
        )

    red, blue = "#a5281b", "#1f5fa8"
    parts = [
        box(40, 60, 190, 110), words(135, 84, "24 V DC supply"),
        words(135, 104, "at least 0.5 A", size=12, colour=GREY),
        words(222, 134, "+24 V", "end"), words(222, 158, "0 V", "end"),
        box(380, 60, 150, 200), words(455, 84, "EK1101"), words(455, 104, "coupler", size=12, colour=GREY),
        words(388, 134, "24 V, +", "start"), words(388, 158, "0 V, −", "start"), words(455, 232, "IN (X1)"),
        box(530, 60, 160, 200), words(610, 84, "EL1252"), words(610, 104, "time stamps", size=12, colour=GREY),
        words(682, 134, "+24 V", "end"), words(682, 158, "0 V", "end"), words(682, 190, "Input 1", "end"),
        box(840, 60, 200, 200), words(940, 84, "E3X-HD41"),
        words(940, 104, "fibre amplifier (PNP)", size=12, colour=GREY),
        words(848, 134, "brown: supply", "start"), words(848, 158, "blue: 0 V", "start"),
        words(848, 190, "black: output", "start"), words(940, 246, "fibres"),
        wire("230,130 380,130", red), wire("230,154 380,154", blue),
        wire("690,130 840,130", red), wire("690,154 840,154", blue), wire("690,186 840,186"),
        box(40, 360, 300, 130), words(190, 386, "Computer (Linux)"),
        words(48, 420, "network adapter of its own", "start"), words(48, 444, "USB", "start"),
        words(48, 468, "video", "start"),
        wire("340,416 455,416 455,260", GREEN),
        words(463, 340, "EtherCAT (network cable)", "start", colour=GREEN),
        box(700, 330, 340, 190), words(870, 432, "touchscreen"),
        line(700, 400, 1040, 400, BEAM, 2.5), box(684, 388, 24, 24, INK), box(1032, 388, 24, 24, INK),
        wire("900,260 900,300 670,300 670,400 684,400", BEAM, "5 4"),
        wire("980,260 980,300 1074,300 1074,400 1056,400", BEAM, "5 4"),
        words(690, 292, "emitting", "start", 12, BEAM), words(1070, 292, "receiving", "end", 12, BEAM),
        wire("340,440 560,440 560,464 700,464"), words(690, 458, "USB", "end", 12, GREY),
        wire("340,464 540,464 540,490 700,490"), words(690, 505, "video", "end", 12, GREY),
        box(380, 540, 180, 50), words(470, 570, "WALT (taps)"), wire("190,490 190,565 380,565"),
        words(200, 556, "USB 2, no hub", "start", 12, GREY),
        words(40, 624, "Pins are named as they are printed on the terminals. On the EK1101 the coupler's and the power "
              "contacts' 24 V are both connected.", "start", 12, GREY),
    ]  # fmt: skip
    return svg(1100, 645, "What is connected to what", parts)


def drawings(rig: Rig) -> dict[str, str]:
    """All drawings by the names of their files."""
    return {"rig-plan.svg": plan(rig), "rig-bracket.svg": bracket(rig), "rig-wiring.svg": wiring()}


def main() -> None:
    """Writes the drawings."""
    parser = argparse.ArgumentParser(description="Draw the rig for a screen of these measures.")
    parser.add_argument("--out", type=Path, default=Path("docs/pictures"), help="folder of the drawings (%(default)s)")
    for one in fields(Rig):
        name = "--" + one.name.replace("_", "-")
        parser.add_argument(name, dest=one.name, type=float, default=one.default, help="%(default)s")
    chosen = vars(parser.parse_args())
    out = chosen.pop("out")
    rig = Rig(**chosen)
    if problem := rig.problem():
        sys.exit(f"{problem}.")
    out.mkdir(parents=True, exist_ok=True)
    for name, text in drawings(rig).items():
        (out / name).write_text(text, "utf-8")


if __name__ == "__main__":
    main()

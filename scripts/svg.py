"""Small pictures as SVG text, with Python's standard library alone."""
import base64
import math
import struct
import zlib
from xml.sax.saxutils import escape

FONT = "Helvetica, Arial, sans-serif"
INK = "#1f2430"
FAINT = "#8a92a0"


class Svg:
    """A picture of width x height pixels, white, filled from back to front."""

    def __init__(self, width, height, title):
        self.width, self.height = width, height
        self.parts = [
            '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
            f'width="{width}" height="{height}" viewBox="0 0 {width} {height}" font-family="{FONT}">',
            f"<title>{escape(title)}</title>",
            f'<rect width="{width}" height="{height}" fill="#ffffff"/>',
        ]

    def rect(self, x, y, w, h, fill="none", stroke="none", width=1.0, rx=0.0):
        self.parts.append(
            f'<rect x="{x:.2f}" y="{y:.2f}" width="{w:.2f}" height="{h:.2f}" rx="{rx:g}" fill="{fill}" stroke="{stroke}" '
            f'stroke-width="{width:g}"/>')

    def line(self, x0, y0, x1, y1, stroke=INK, width=1.0, dash=None, arrow=False):
        extra = f' stroke-dasharray="{dash}"' if dash else ""
        self.parts.append(
            f'<line x1="{x0:.2f}" y1="{y0:.2f}" x2="{x1:.2f}" y2="{y1:.2f}" stroke="{stroke}" stroke-width="{width:g}"{extra}/>')
        if arrow:
            self._head(x0, y0, x1, y1, stroke)

    def _head(self, x0, y0, x1, y1, fill, size=7.0):
        a = math.atan2(y1 - y0, x1 - x0)
        corners = [(x1, y1)] + [(x1 - size * math.cos(a + s), y1 - size * math.sin(a + s)) for s in (0.45, -0.45)]
        self.parts.append(f'<polygon points="{_points(corners)}" fill="{fill}"/>')

    def polyline(self, points, stroke=INK, width=1.5, dash=None):
        extra = f' stroke-dasharray="{dash}"' if dash else ""
        self.parts.append(
            f'<polyline points="{_points(points)}" fill="none" stroke="{stroke}" stroke-width="{width:g}" '
            f'stroke-linejoin="round"{extra}/>')

    def text(self, x, y, text, size=12, fill=INK, anchor="start", weight="normal", turn=0):
        turned = f' transform="rotate({turn} {x:.2f} {y:.2f})"' if turn else ""
        self.parts.append(f'<text x="{x:.2f}" y="{y:.2f}" font-size="{size}" fill="{fill}" text-anchor="{anchor}" '
                          f'font-weight="{weight}"{turned}>{escape(text)}</text>')

    def image(self, x, y, w, h, rows):
        """Rows of (r, g, b) bytes, the first at the top; enlarged without smoothing."""
        data = base64.b64encode(_png(rows)).decode()
        self.parts.append(f'<image x="{x:.2f}" y="{y:.2f}" width="{w:.2f}" height="{h:.2f}" preserveAspectRatio="none" '
                          f'style="image-rendering:pixelated" xlink:href="data:image/png;base64,{data}"/>')

    def __str__(self):
        return "\n".join(self.parts + ["</svg>", ""])


def _points(points):
    return " ".join(f"{x:.2f},{y:.2f}" for x, y in points)


def _png(rows, enlarge=3):
    """Pixels enlarged, because not every viewer obeys image-rendering."""
    height, width = len(rows), len(rows[0])
    raw = b"".join((b"\0" + b"".join(bytes(p) * enlarge for p in row)) * enlarge for row in rows)

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = struct.pack(">IIBBBBB", width * enlarge, height * enlarge, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(raw, 9)) + chunk(b"IEND", b"")


_SCALE = [(240, 244, 250), (178, 212, 226), (84, 160, 190), (30, 92, 148), (10, 32, 84)]  # light to dark


def colour_of(value, low, high):
    """(r, g, b) of a value in [low, high]."""
    t = min(max((value - low) / (high - low), 0.0), 1.0) * (len(_SCALE) - 1) if high > low else 0.0
    i = min(int(t), len(_SCALE) - 2)
    return tuple(round(a + (b - a) * (t - i)) for a, b in zip(_SCALE[i], _SCALE[i + 1]))


def hex_of(rgb):
    return "#%02x%02x%02x" % tuple(rgb)


class Axes:
    """A plot's frame: from data to pixels."""

    def __init__(self, svg, box, x_range, y_range):
        self.svg, self.box = svg, box
        self.x_range, self.y_range = x_range, y_range

    def x(self, v):
        left, _, width, _ = self.box
        return left + width * _part(v, self.x_range)

    def y(self, v):
        _, top, _, height = self.box
        return top + height * (1 - _part(v, self.y_range))

    def frame(self, x_ticks, y_ticks, x_label, y_label, size=11):
        left, top, width, height = self.box
        for v, label in x_ticks:
            self.svg.line(self.x(v), top, self.x(v), top + height, "#e6e8ec", 0.8)
            self.svg.text(self.x(v), top + height + size + 4, label, size, FAINT, "middle")
        for v, label in y_ticks:
            self.svg.line(left, self.y(v), left + width, self.y(v), "#e6e8ec", 0.8)
            self.svg.text(left - 6, self.y(v) + size * 0.35, label, size, FAINT, "end")
        self.svg.rect(left, top, width, height, "none", "#b8bec8", 1)
        self.svg.text(left + width / 2, top + height + 2 * size + 12, x_label, size + 1, INK, "middle")
        if y_label:
            self.svg.text(left - 44, top + height / 2, y_label, size + 1, INK, "middle", turn=-90)


def _part(v, ends):
    return (v - ends[0]) / (ends[1] - ends[0])

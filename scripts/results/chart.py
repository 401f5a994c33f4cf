"""Charts as SVG text: lines with markers over linear or logarithmic axes, and grouped bars."""
import html
import math

COLORS = ["#1b6ca8", "#d1495b", "#2e933c", "#8d5a97", "#e08e0b", "#4d4d4d", "#17a2a2", "#a0522d"]
WIDTH, HEIGHT = 720, 400
LEFT, RIGHT, TOP, BOTTOM = 74, 200, 36, 56


def text(x, y, words, anchor="middle", size=13, turn=None, weight="normal"):
    rotate = ' transform="rotate(%d %.1f %.1f)"' % (turn, x, y) if turn else ""
    return '<text x="%.1f" y="%.1f" text-anchor="%s" font-size="%d" font-weight="%s"%s>%s</text>' % (
        x, y, anchor, size, weight, rotate, html.escape(str(words)))


def line(x1, y1, x2, y2, color="#ddd", width=1):
    return '<line x1="%.1f" y1="%.1f" x2="%.1f" y2="%.1f" stroke="%s" stroke-width="%g"/>' % (x1, y1, x2, y2,
                                                                                        color, width)


def short(x):
    return "%g" % float("%.3g" % x)


class Axis:
    """Maps values to positions between `start` and `end`."""

    def __init__(self, values, start, end, log=False, zero=False):
        values = [v for v in values if math.isfinite(v) and (v > 0 or not log)] or [1.0]
        low, high = min(values), max(values)
        if zero and not log:
            low = min(low, 0)
        if low == high:
            low, high = (low / 2, high * 2) if log and low > 0 else (low - 0.5, high + 0.5)
        self.log, self.start, self.end = log, start, end
        if log:
            self.low, self.high = math.log(low / 1.1), math.log(high * 1.1)
        else:
            step = self.step(high - low)
            self.low, self.high = math.floor(low / step) * step, math.ceil(high / step) * step

    @staticmethod
    def step(extent):
        power = 10 ** math.floor(math.log10(extent / 4))
        return next(power * m for m in (1, 2, 5, 10) if power * m * 5 >= extent)

    def place(self, v):
        if self.log:
            v = math.log(v) if v > 0 else self.low
        return self.start + (self.end - self.start) * (v - self.low) / (self.high - self.low)

    def ticks(self):
        if not self.log:
            step = self.step(self.high - self.low)
            count = int(round((self.high - self.low) / step))
            return [self.low + i * step for i in range(count + 1)]
        low, high = math.exp(self.low), math.exp(self.high)
        decades = math.log10(high / low)
        marks = (1,) if decades > 3 else (1, 2, 5) if decades > 0.8 else (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8)
        ticks = []
        for power in range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1):
            ticks += [m * 10.0 ** power for m in marks if low <= m * 10.0 ** power <= high]
        return ticks


def frame(title, x_label, y_label, body, names):
    legend = []
    for i, name in enumerate(names):
        y = TOP + 14 + 20 * i
        legend += ['<rect x="%d" y="%d" width="12" height="12" fill="%s"/>' % (WIDTH - RIGHT + 16, y - 10,
                                                                            COLORS[i % len(COLORS)]),
                   text(WIDTH - RIGHT + 34, y, name, "start", 12)]
    parts = ['<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 %d %d" font-family="sans-serif">' % (WIDTH, HEIGHT),
             '<rect width="%d" height="%d" fill="white"/>' % (WIDTH, HEIGHT),
             text(LEFT, 22, title, "start", 15, weight="bold"), *body,
             text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 14, x_label),
             text(18, (TOP + HEIGHT - BOTTOM) / 2, y_label, turn=-90), *legend, "</svg>"]
    return "\n".join(parts) + "\n"


def grid(x_axis, y_axis):
    body = []
    for v in y_axis.ticks():
        y = y_axis.place(v)
        body += [line(LEFT, y, WIDTH - RIGHT, y), text(LEFT - 6, y + 4, short(v), "end", 12)]
    for v in x_axis.ticks() if x_axis else []:
        x = x_axis.place(v)
        body += [line(x, TOP, x, HEIGHT - BOTTOM), text(x, HEIGHT - BOTTOM + 18, short(v), size=12)]
    body.append('<rect x="%d" y="%d" width="%d" height="%d" fill="none" stroke="#555"/>' % (
        LEFT, TOP, WIDTH - RIGHT - LEFT, HEIGHT - BOTTOM - TOP))
    return body


def lines(title, x_label, y_label, series, log_x=False, log_y=False):
    """series: (name, [(x, y), ...]); points that are not finite are left out."""
    drawn = [(name, [(x, y) for x, y in points if math.isfinite(x) and math.isfinite(y) and (y > 0 or not log_y)])
             for name, points in series]
    xs = [x for _, points in drawn for x, _ in points]
    ys = [y for _, points in drawn for _, y in points]
    x_axis = Axis(xs, LEFT, WIDTH - RIGHT, log_x)
    y_axis = Axis(ys, HEIGHT - BOTTOM, TOP, log_y, zero=True)
    body = grid(x_axis, y_axis)
    for i, (_, points) in enumerate(drawn):
        color = COLORS[i % len(COLORS)]
        places = [(x_axis.place(x), y_axis.place(y)) for x, y in points]
        if len(places) > 1:
            body.append('<polyline points="%s" fill="none" stroke="%s" stroke-width="2"/>' % (
                " ".join("%.1f,%.1f" % p for p in places), color))
        body += ['<circle cx="%.1f" cy="%.1f" r="3.5" fill="%s"/>' % (x, y, color) for x, y in places]
    return frame(title, x_label, y_label, body, [name for name, _ in drawn])


def bars(title, y_label, groups, names, values, log_y=False):
    """values[name index][group index]; NaN leaves a gap. Bars grow from 1 on a log axis, else from 0."""
    finite = [v for row in values for v in row if math.isfinite(v)]
    y_axis = Axis(finite + ([1.0] if log_y else []), HEIGHT - BOTTOM, TOP, log_y, zero=True)
    body = grid(None, y_axis)
    extent = (WIDTH - RIGHT - LEFT) / max(1, len(groups))
    base = y_axis.place(1.0 if log_y else 0.0)
    for g, group in enumerate(groups):
        left = LEFT + g * extent
        for n in range(len(names)):
            v = values[n][g]
            if not math.isfinite(v):
                continue
            width = 0.8 * extent / len(names)
            y = y_axis.place(v)
            body.append('<rect x="%.1f" y="%.1f" width="%.1f" height="%.1f" fill="%s"/>' % (
                left + 0.1 * extent + n * width, min(y, base), width, abs(y - base), COLORS[n % len(COLORS)]))
        turn = -25 if len(groups) > 5 else None
        body.append(text(left + extent / 2 + (12 if turn else 0), HEIGHT - BOTTOM + 16, group, "end" if turn else "middle",
                         11, turn))
    return frame(title, "", y_label, body, names)

//! Line charts as SVG, for the figures of values.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// Width and height of a chart, px.
const SIZE: [f64; 2] = [720.0, 440.0];
/// Left, top, right and bottom margins of the frame of a chart, px.
const MARGIN: [f64; 4] = [70.0, 34.0, 130.0, 52.0];

/// One axis of a chart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// Name and unit of the quantity.
    pub label: String,
    /// Minimum and maximum.
    pub range: [f64; 2],
    /// True for a logarithmic axis, whose range is above 0.
    pub log: bool,
}

impl Axis {
    /// An axis over the finite values, with a margin; over positive ones if it is logarithmic.
    #[must_use]
    pub fn over(label: impl Into<String>, values: impl Iterator<Item = f64>, log: bool) -> Self {
        let finite = values.filter(|x| x.is_finite() && (!log || *x > 0.0));
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        let range = match (low < high, log) {
            (true, true) => [0.9 * low, 1.1 * high],
            (true, false) => [low - 0.03 * (high - low), high + 0.03 * (high - low)],
            (false, true) if low.is_finite() => [0.5 * low, 2.0 * low],
            (false, false) if low.is_finite() => [low - 1.0, low + 1.0],
            (false, true) => [1.0, 10.0],
            (false, false) => [0.0, 1.0],
        };
        Self { label: label.into(), range, log }
    }

    /// Position of a value along the axis: 0 to 1 within the range.
    fn fraction(&self, x: f64) -> f64 {
        let scaled = |x: f64| if self.log { x.max(f64::MIN_POSITIVE).log10() } else { x };
        let [low, high] = self.range.map(scaled);
        (scaled(x) - low) / (high - low).max(f64::MIN_POSITIVE)
    }

    /// Values with a grid line and a label.
    fn ticks(&self) -> Vec<f64> {
        let [low, high] = self.range;
        if self.log {
            let (first, last) = (low.log10().ceil() as i32, high.log10().floor() as i32);
            // At most nine labels.
            let step = ((last - first) / 8 + 1).max(1) as usize;
            return (first..=last).step_by(step).map(|e| 10f64.powi(e)).collect();
        }
        let min_step = (high - low) / 6.0;
        let power = 10f64.powf(min_step.log10().floor());
        let step = power * [1.0, 2.0, 5.0, 10.0].into_iter().find(|m| m * power >= min_step).unwrap_or(10.0);
        let first = (low / step).ceil() as i64;
        (0..20).map(|k| (first + k) as f64 * step).take_while(|x| *x <= high + 1e-9 * step).collect()
    }
}

/// One line of a chart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// Label in the legend.
    pub label: String,
    /// Points of the line.
    pub points: Vec<[f64; 2]>,
    /// True to draw a dot at each point, without a line between them.
    pub dots: bool,
}

impl Line {
    /// A line through points.
    #[must_use]
    pub fn new(label: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        Self { label: label.into(), points, dots: false }
    }

    /// A dot at each point.
    #[must_use]
    pub fn dots(label: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        Self { dots: true, ..Self::new(label, points) }
    }
}

/// A line chart as a value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Chart {
    /// Title.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Lines and dots.
    pub lines: Vec<Line>,
}

impl Chart {
    /// A chart whose axes span its lines; each axis is a label, and true for a logarithmic one.
    #[must_use]
    pub fn of(title: impl Into<String>, x: (&str, bool), y: (&str, bool), lines: Vec<Line>) -> Self {
        let values = |k: usize| lines.iter().flat_map(move |l| l.points.iter().map(move |p| p[k]));
        let axis = |k: usize, (label, log): (&str, bool)| Axis::over(label, values(k), log);
        Self { title: title.into(), x: axis(0, x), y: axis(1, y), lines }
    }

    /// Draws it as [`chart`].
    #[must_use]
    pub fn draw(&self) -> String {
        chart(&self.title, &self.x, &self.y, &self.lines)
    }
}

/// A grey picture that fills the frame of a chart: a PNG in base64.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Image(String);

impl Image {
    /// Encodes one byte per pixel, `[height, width]` from the top left on, 0 for black; `None` if there are none.
    #[must_use]
    pub fn grey(size: [usize; 2], pixels: &[u8]) -> Option<Self> {
        grey_png(size, pixels).map(|png| Self(STANDARD.encode(png)))
    }

    /// Returns true for the default, which has no pixels.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// An SVG element of the picture.
    pub(crate) fn element(&self, [left, top, width, height]: [f64; 4]) -> String {
        format!(
            "<image x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height:.1}\" preserveAspectRatio=\"none\" \
             href=\"data:image/png;base64,{}\"/>",
            self.0
        )
    }
}

/// Encodes one byte per pixel as a grey PNG.
pub(crate) fn grey_png([width, height]: [usize; 2], bytes: &[u8]) -> Option<Vec<u8>> {
    let mut out = Vec::new();
    let (width, height) = (u32::try_from(width).ok()?, u32::try_from(height).ok()?);
    let mut encoder = png::Encoder::new(&mut out, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.write_header().ok()?.write_image_data(bytes).ok()?;
    Some(out)
}

/// Draws a chart of lines as an SVG document; the colours change from blue for the first line to red for the last.
///
/// Points outside of the ranges of the axes are clamped to the frame.
#[must_use]
pub fn chart(title: &str, x: &Axis, y: &Axis, lines: &[Line]) -> String {
    chart_over(None, title, x, y, lines)
}

/// Draws a chart over an image, as [`chart`].
#[must_use]
pub fn chart_over(image: Option<&Image>, title: &str, x: &Axis, y: &Axis, lines: &[Line]) -> String {
    let [width, height] = SIZE;
    let [left, top, right, bottom] = MARGIN;
    let pixel = |p: [f64; 2]| {
        let (u, v) = (x.fraction(p[0]).clamp(0.0, 1.0), y.fraction(p[1]).clamp(0.0, 1.0));
        [left + u * (width - left - right), height - bottom - v * (height - top - bottom)]
    };
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    let frame = [left, top, width - left - right, height - top - bottom];
    if let Some(image) = image {
        svg += &image.element(frame);
        svg.push('\n');
    }
    let mut text = |x: f64, y: f64, anchor: &str, extra: &str, text: &str| {
        let text = escaped(text);
        // Writing to a string cannot fail.
        let _ =
            writeln!(svg, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\"{extra}>{text}</text>");
    };
    text(left, top - 14.0, "start", " font-weight=\"bold\"", title);
    text((left + width - right) / 2.0, height - 12.0, "middle", "", &x.label);
    let middle = (top + height - bottom) / 2.0;
    text(16.0, middle, "middle", &format!(" transform=\"rotate(-90 16 {middle:.1})\""), &y.label);
    for tick in x.ticks() {
        text(pixel([tick, y.range[0]])[0], height - bottom + 16.0, "middle", "", &number(tick));
    }
    for tick in y.ticks() {
        text(left - 6.0, pixel([x.range[0], tick])[1] + 4.0, "end", "", &number(tick));
    }
    for (k, line) in lines.iter().enumerate() {
        let y = top + 10.0 + 16.0 * k as f64;
        if y < height - bottom {
            text(width - right + 34.0, y + 4.0, "start", "", &line.label);
        }
    }
    let mut stroke = |from: [f64; 2], to: [f64; 2], colour: &str| {
        let ([x1, y1], [x2, y2]) = (from, to);
        let _ = writeln!(
            svg,
            "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"{colour}\"/>"
        );
    };
    for tick in x.ticks() {
        stroke(pixel([tick, y.range[0]]), pixel([tick, y.range[1]]), "#ddd");
    }
    for tick in y.ticks() {
        stroke(pixel([x.range[0], tick]), pixel([x.range[1], tick]), "#ddd");
    }
    for (k, _) in lines.iter().enumerate() {
        let y = top + 10.0 + 16.0 * k as f64;
        if y < height - bottom {
            stroke([width - right + 10.0, y], [width - right + 30.0, y], &colour(k, lines.len()));
        }
    }
    for (k, line) in lines.iter().enumerate() {
        let colour = colour(k, lines.len());
        if line.dots {
            for [x, y] in line.points.iter().map(|&p| pixel(p)) {
                let _ = writeln!(
                    svg,
                    "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2\" fill=\"{colour}\" fill-opacity=\"0.6\"/>"
                );
            }
            continue;
        }
        let points = line.points.iter().map(|&p| pixel(p)).map(|[x, y]| format!("{x:.1},{y:.1}"));
        let points = points.collect::<Vec<_>>().join(" ");
        let _ = writeln!(svg, "<polyline points=\"{points}\" fill=\"none\" stroke=\"{colour}\"/>");
    }
    let (w, h) = (width - left - right, height - top - bottom);
    let _ = writeln!(
        svg,
        "<rect x=\"{left}\" y=\"{top}\" width=\"{w}\" height=\"{h}\" fill=\"none\" stroke=\"black\"/>\n</svg>"
    );
    svg
}

/// An interval of the horizontal axis that is marked in a chart.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Span {
    /// Its ends.
    pub range: [f64; 2],
    /// Text at its beginning; may be empty.
    pub label: String,
    /// Colour, as of [`colour`].
    pub colour: String,
    /// True to mark it over the whole height of the chart, false for its upper edge only.
    pub is_full: bool,
}

/// Height of the rows of labels of spans, and of a mark at the upper edge, px.
const SPAN_ROW: f64 = 12.0;
const SPAN_EDGE: f64 = 5.0;

/// Marks intervals in a chart of [`chart_over`] whose horizontal axis is `x`. Labels that would overlap stand in up to six rows.
#[must_use]
pub(crate) fn with_spans(svg: &str, x: &Axis, spans: &[Span]) -> String {
    let [left, top, right, bottom] = MARGIN;
    let (width, height) = (SIZE[0] - left - right, SIZE[1] - top - bottom);
    let mut sorted: Vec<&Span> = spans.iter().collect();
    sorted.sort_by(|a, b| a.range[0].total_cmp(&b.range[0]));
    let (mut marks, mut ends) = (String::new(), [f64::NEG_INFINITY; 6]);
    for span in sorted {
        let [from, to] = span.range.map(|t| left + x.fraction(t).clamp(0.0, 1.0) * width);
        let (w, colour) = ((to - from).max(1.0), &span.colour);
        let mut rect = |y: f64, h: f64, opacity: f64| {
            // Writing to a string cannot fail.
            let _ = writeln!(
                marks,
                "<rect x=\"{from:.1}\" y=\"{y:.1}\" width=\"{w:.1}\" height=\"{h:.1}\" fill=\"{colour}\" \
                 fill-opacity=\"{opacity}\"/>"
            );
        };
        rect(top, SPAN_EDGE, 1.0);
        if span.is_full {
            rect(top, height, 0.25);
        }
        if span.label.is_empty() {
            continue;
        }
        // About half an em for each character.
        let length = 0.55 * 10.0 * span.label.chars().count() as f64;
        let at = from.min(left + width - length);
        let row = ends.iter().position(|end| *end < at).unwrap_or(ends.len() - 1);
        ends[row] = at + length + 4.0;
        let y = top + SPAN_EDGE + SPAN_ROW * (row as f64 + 0.8);
        let label = escaped(&span.label);
        let _ = writeln!(
            marks,
            "<rect x=\"{at:.1}\" y=\"{:.1}\" width=\"{length:.1}\" height=\"{SPAN_ROW}\" fill=\"white\" fill-opacity=\"0.8\"/>\n\
             <text x=\"{at:.1}\" y=\"{y:.1}\" font-size=\"10\" fill=\"{colour}\">{label}</text>",
            y - 0.8 * SPAN_ROW
        );
    }
    match svg.rfind("</svg>") {
        Some(end) => format!("{}{marks}{}", &svg[..end], &svg[end..]),
        None => svg.to_owned(),
    }
}

/// Puts a chart over the whole width above charts in rows of `columns`, as one SVG document.
#[must_use]
pub(crate) fn grid_below(first: &str, charts: &[String], columns: usize) -> String {
    let columns = columns.max(1);
    let scale = columns as f64;
    let [width, height] = SIZE.map(|size| scale * size);
    let total = height + SIZE[1] * charts.len().div_ceil(columns) as f64;
    let below = grid(charts, columns);
    let top = first.replacen("<svg ", &format!("<svg width=\"{width}\" height=\"{height}\" "), 1);
    let place = format!("<svg y=\"{height}\" width=\"{width}\" height=\"{}\" ", total - height);
    let below = below.replacen("<svg ", &place, 1);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {total}\">\n{top}{below}</svg>\n"
    )
}

/// Puts charts beside each other as one SVG document.
#[must_use]
pub fn beside(charts: &[String]) -> String {
    grid(charts, charts.len())
}

/// Puts charts into rows of `columns` charts each, as one SVG document.
#[must_use]
pub fn grid(charts: &[String], columns: usize) -> String {
    let [width, height] = SIZE;
    let columns = columns.max(1);
    let total = [
        width * columns.min(charts.len().max(1)) as f64,
        height * charts.len().div_ceil(columns).max(1) as f64,
    ];
    let mut svg =
        format!("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\">\n", total[0], total[1]);
    for (k, chart) in charts.iter().enumerate() {
        let (x, y) = (width * (k % columns) as f64, height * (k / columns) as f64);
        let place = match k / columns {
            0 => format!("<svg x=\"{x}\" width=\"{width}\" height=\"{height}\" "),
            _ => format!("<svg x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" "),
        };
        svg += &chart.replacen("<svg ", &place, 1);
    }
    svg + "</svg>\n"
}

/// Colour `k` of `count`, from blue to red.
pub(crate) fn colour(k: usize, count: usize) -> String {
    let fraction = k as f64 / (count.max(2) - 1) as f64;
    // Hue in sixths of a circle, as hexadecimal RGB, which all SVG readers support.
    let hue = 4.0 * (1.0 - fraction);
    let channel = |centre: f64| {
        let intensity = (2.0 - (hue - centre).abs().min(6.0 - (hue - centre).abs())).clamp(0.0, 1.0);
        ((0.08 + 0.68 * intensity) * 255.0).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", channel(0.0), channel(2.0), channel(4.0))
}

/// Escapes text for SVG.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

/// Formats a number with at most six decimals.
fn number(x: f64) -> String {
    if x == 0.0 || (1e-3..1e5).contains(&x.abs()) {
        format!("{}", (x * 1e6).round() / 1e6)
    } else {
        format!("{x:.0e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(range: [f64; 2]) -> Axis {
        Axis { label: "f".into(), range, log: true }
    }

    #[test]
    fn logarithmic_ticks_are_powers_of_ten_inside_the_range() {
        assert_eq!(log([20.0, 24000.0]).ticks(), [100.0, 1000.0, 10000.0]);
        assert!(log([1e-30, 1.0]).ticks().len() <= 9);
        let linear = Axis { log: false, ..log([0.0, 1.0]) };
        assert_eq!(linear.ticks().len(), 6);
    }

    #[test]
    fn a_line_is_drawn_where_its_points_are() {
        let ends = vec![[10.0, 1.0], [1000.0, 100.0]];
        let lines = [Line::new("a < b", ends.clone()), Line::dots("c", ends)];
        let svg = chart("t", &log([10.0, 1000.0]), &log([1.0, 100.0]), &lines);
        assert!(svg.contains("points=\"70.0,388.0 590.0,34.0\""), "{svg}");
        assert!(svg.contains("a &lt; b") && svg.ends_with("</svg>\n"));
        assert_eq!((svg.matches("<polyline").count(), svg.matches("<circle").count()), (1, 2));
    }

    #[test]
    fn spans_are_marked_where_they_are_and_their_labels_do_not_overlap() {
        let x = Axis { label: "t".into(), range: [0.0, 10.0], log: false };
        let plain = chart("t", &x, &log([1.0, 100.0]), &[]);
        let span = |from: f64, label: &str, is_full| Span {
            range: [from, from + 1.0],
            label: label.into(),
            colour: "#ff0000".into(),
            is_full,
        };
        let svg =
            with_spans(&plain, &x, &[span(5.0, "a & b", true), span(5.1, "c", true), span(0.0, "", false)]);
        assert!(svg.contains("<rect x=\"330.0\" y=\"34.0\" width=\"52.0\" height=\"354.0\""), "{svg}");
        assert!(svg.contains("y=\"48.6\" font-size=\"10\" fill=\"#ff0000\">a &amp; b"), "{svg}");
        assert!(svg.contains("y=\"60.6\" font-size=\"10\" fill=\"#ff0000\">c<"), "{svg}");
        assert_eq!(svg.matches("height=\"5.0\"").count(), 3);
        let all = grid_below(&svg, &vec![plain; 3], 2);
        assert!(all.contains("viewBox=\"0 0 1440 1760\"") && all.contains("<svg y=\"880\""), "{all}");
    }
}

//! A drawing as SVG text.

use super::coordinates::{Coordinates, MARGIN, MAX_CHARS, Point, assign_coordinates, port_y, text_width};
use super::{Drawing, NodeBox, WireKind};
use std::fmt::Write as _;

const KINDS: [(WireKind, &str, &str); 5] = [
    (WireKind::Audio, "audio", "#2563eb"),
    (WireKind::Stream, "other stream", "#0f9d8a"),
    (WireKind::Events, "events", "#d97706"),
    (WireKind::Value, "value", "#7c3aed"),
    (WireKind::Fold, "fold (value of a whole stream)", "#db2777"),
];

fn colour(kind: WireKind) -> &'static str {
    KINDS.iter().find(|(k, _, _)| *k == kind).map_or("#000", |(_, _, colour)| colour)
}

/// Escapes a text for SVG; characters that XML does not allow are replaced or left out.
fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\u{FFFE}' | '\u{FFFF}' => {}
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

/// Escapes a name, truncated if it is too long.
fn short(text: &str) -> String {
    match text.char_indices().nth(MAX_CHARS) {
        Some(_) => escape(&format!("{}…", text.chars().take(MAX_CHARS - 1).collect::<String>())),
        None => escape(text),
    }
}

/// Formats a drawing as an SVG file; the same drawing always results in the same text.
#[must_use]
pub fn svg(drawing: &Drawing) -> String {
    let coordinates = assign_coordinates(drawing);
    let Coordinates { width, height, .. } = coordinates;
    let height = height + 30.0;
    let mut out = String::new();
    let _ = writeln!(
        out,
        r##"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" font-family="Helvetica, Arial, 'DejaVu Sans', sans-serif">
<rect width="{width}" height="{height}" fill="#ffffff"/>"##
    );
    if !drawing.title.is_empty() {
        let _ = writeln!(
            out,
            r##"<text x="{MARGIN}" y="38" font-size="18" font-weight="bold" fill="#111827">{}</text>"##,
            escape(&drawing.title)
        );
    }
    for (wire, points) in drawing.wires.iter().zip(&coordinates.wires) {
        let (from, to) = (&drawing.boxes[wire.from.0], &drawing.boxes[wire.to.0]);
        let output = &from.outputs[wire.from.1];
        let dash = if wire.back { r#" stroke-dasharray="5 4""# } else { "" };
        let _ = writeln!(
            out,
            r#"<path d="{}" fill="none" stroke="{}" stroke-width="1.8"{dash}><title>{}.{} to {}.{} {}</title></path>"#,
            if wire.back { corners(points) } else { curve(points) },
            colour(output.kind),
            escape(&from.id),
            escape(&output.name),
            escape(&to.id),
            escape(&to.inputs[wire.to.1].0),
            escape(&output.label),
        );
    }
    for (b, node) in drawing.boxes.iter().enumerate() {
        draw_box(&mut out, drawing, &coordinates, b, node);
    }
    legend(&mut out, drawing, height - MARGIN);
    out.push_str("</svg>\n");
    out
}

fn draw_box(out: &mut String, drawing: &Drawing, coordinates: &Coordinates, b: usize, node: &NodeBox) {
    let r = coordinates.boxes[b];
    let _ = writeln!(
        out,
        r##"<g><title>{id} ({ty})</title>
<rect x="{x}" y="{y}" width="{w}" height="{h}" rx="7" fill="#f8fafc" stroke="#334155" stroke-width="1.2"/>
<text x="{tx}" y="{y1}" font-size="13.5" font-weight="bold" fill="#111827">{shown}</text>
<text x="{tx}" y="{y2}" font-size="11" fill="#64748b">{ty}</text>"##,
        id = escape(&node.id),
        ty = short(&node.type_name),
        x = r.x,
        y = r.y,
        w = r.w,
        h = r.h,
        tx = r.x + 10.0,
        y1 = r.y + 18.0,
        shown = short(&node.id),
        y2 = r.y + 33.0,
    );
    for (k, (name, linked)) in node.inputs.iter().enumerate() {
        let y = r.y + port_y(k);
        let kind = drawing.wires.iter().find(|w| w.to == (b, k));
        let kind = kind.map(|w| drawing.boxes[w.from.0].outputs[w.from.1].kind);
        let fill = kind.map_or("#ffffff", colour);
        let ink = if *linked { "#1f2937" } else { "#94a3b8" };
        let _ = writeln!(
            out,
            r##"<circle cx="{}" cy="{y}" r="3.5" fill="{fill}" stroke="{ink}" stroke-width="0.8"/><text x="{}" y="{}" font-size="11" fill="{ink}">{}</text>"##,
            r.x,
            r.x + 9.0,
            y + 4.0,
            short(name)
        );
    }
    for (k, port) in node.outputs.iter().enumerate() {
        let y = r.y + port_y(k);
        let edge = r.x + r.w;
        let _ = writeln!(
            out,
            r##"<circle cx="{edge}" cy="{y}" r="3.5" fill="{}" stroke="#1f2937" stroke-width="0.8"/><text x="{}" y="{}" font-size="11" fill="#1f2937" text-anchor="end">{}</text>"##,
            colour(port.kind),
            edge - 9.0,
            y + 4.0,
            short(&port.name)
        );
        if !port.label.is_empty() {
            let _ = writeln!(
                out,
                r##"<text x="{}" y="{}" font-size="10" fill="#475569">{}</text>"##,
                edge + 7.0,
                y - 4.0,
                short(&port.label)
            );
        }
    }
    out.push_str("</g>\n");
}

/// The path of a link that is horizontal beside boxes and bends between layers.
fn curve(points: &[Point]) -> String {
    let mut d = String::new();
    let mut last = (0.0, 0.0);
    for (k, &(x, y)) in points.iter().enumerate() {
        let _ = match k {
            0 => write!(d, "M{x} {y}"),
            _ if last.1 == y => write!(d, " H{x}"),
            _ => {
                let middle = f64::midpoint(last.0, x);
                write!(d, " C{middle} {} {middle} {y} {x} {y}", last.1)
            }
        };
        last = (x, y);
    }
    d
}

/// The path of a link around the boxes, with right angles and round corners.
fn corners(points: &[Point]) -> String {
    const ROUND: f64 = 7.0;
    let mut d = String::new();
    for (k, &(x, y)) in points.iter().enumerate() {
        let _ = match (k.checked_sub(1).map(|k| points[k]), points.get(k + 1)) {
            (None, _) => write!(d, "M{x} {y}"),
            (Some(_), None) => write!(d, " L{x} {y}"),
            (Some(before), Some(&after)) => {
                let towards = |(px, py): Point| {
                    let (dx, dy) = (px - x, py - y);
                    let length = dx.hypot(dy).max(1e-9);
                    let step = ROUND.min(length / 2.0) / length;
                    (x + dx * step, y + dy * step)
                };
                let (a, b) = (towards(before), towards(after));
                write!(d, " L{} {} Q{x} {y} {} {}", a.0, a.1, b.0, b.1)
            }
        };
    }
    d
}

/// Draws the legend of the colours in use.
fn legend(out: &mut String, drawing: &Drawing, y: f64) {
    let mut x = MARGIN;
    let mut entry = |out: &mut String, name: &str, colour: &str, dash: &str| {
        let _ = writeln!(
            out,
            r##"<path d="M{x} {} H{}" stroke="{colour}" stroke-width="2.4"{dash}/><text x="{}" y="{y}" font-size="11" fill="#334155">{name}</text>"##,
            y - 4.0,
            x + 22.0,
            x + 28.0
        );
        x += 28.0 + text_width(name, 11.0) + 18.0;
    };
    let kind_of = |w: &super::Wire| drawing.boxes[w.from.0].outputs[w.from.1].kind;
    for (kind, name, colour) in KINDS {
        if drawing.wires.iter().any(|w| kind_of(w) == kind) {
            entry(out, name, colour, "");
        }
    }
    if drawing.wires.iter().any(|w| w.back) {
        entry(out, "closes a loop", "#475569", r#" stroke-dasharray="5 4""#);
    }
}

//! The map that answers to the mouse and the keyboard; without scripts the page is whole without it.

use crate::report::draw::{colours, escape};
use crate::report::statistics::{Sorted, nice_above};
use crate::report::summary::Summary;
use crate::report::{ResultSet, RowMotion, Status, StoneRow};
use nalgebra::Point2;
use serde_json::{Value, json};
use std::fmt::Write;

const SCRIPT: &str = include_str!("explorer.js");

/// Quantities to choose from: key in the script, label.
const QUANTITIES: [(&str, &str); 9] = [
    ("out", "Out of the wall"),
    ("along", "Along the wall"),
    ("up", "Up the face"),
    ("norm", "Length of the motion"),
    ("relative", "Against the neighbours"),
    ("limit", "Detection limit (LoD95)"),
    ("rotation", "Rotation"),
    ("confidence", "Confidence of the outline"),
    ("status", "Outcome"),
];

/// Controls and canvas, hidden until the script shows them.
pub(super) fn explorer() -> String {
    let options: String = QUANTITIES.iter().fold(String::new(), |mut out, (key, label)| {
        let _ = write!(out, "<option value=\"{key}\">{}</option>", escape(label));
        out
    });
    format!(
        "<div id=\"explore\" hidden><div class=\"controls\">\
         <label>Show <select id=\"quantity\">{options}</select></label>\
         <label><input type=\"checkbox\" id=\"fade\" checked> fade below the detection limit</label>\
         <label><input type=\"checkbox\" id=\"arrows\"> in-plane arrows</label>\
         <label>Stone <input id=\"search\" type=\"search\" inputmode=\"numeric\" size=\"7\" placeholder=\"id\"></label>\
         <span class=\"zoom\"><button type=\"button\" id=\"zoom-in\" aria-label=\"zoom in\">+</button>\
         <button type=\"button\" id=\"zoom-out\" aria-label=\"zoom out\">\u{2212}</button>\
         <button type=\"button\" id=\"zoom-all\">whole wall</button></span></div>\
         <div class=\"view\"><canvas id=\"wall\" tabindex=\"0\" aria-label=\"map of the stones; arrow keys move, plus and minus zoom\">\
         </canvas><div id=\"tip\" hidden></div></div>\
         <div id=\"stone\" aria-live=\"polite\"><p class=\"note\">Point at a stone for its motion, click to keep it. Drag to move; \
         zoom with the buttons, a double click, or the wheel after a click.</p></div></div>\n"
    )
}

/// Data and script, for the end of the page.
pub(super) fn script(results: &ResultSet, facts: &Summary, component_limit_m: f64) -> String {
    let data = data(results, facts, component_limit_m).to_string();
    // Inside a script element only the end tag could do harm; no "<" is left at all.
    let data = data.replace('<', "\\u003c");
    format!("<script type=\"application/json\" id=\"data\">{data}</script>\n<script>\n{SCRIPT}</script>\n")
}

/// Columns of whole numbers: places in mm, motions in 0.01 mm, rotations in 0.01 mrad, shares in percent.
fn data(results: &ResultSet, facts: &Summary, component_limit_m: f64) -> Value {
    let stones = &results.stones;
    let whole = |v: f64, unit: f64| {
        if v.is_finite() {
            json!((v / unit).round() as i64)
        } else {
            Value::Null
        }
    };
    let column = |of: &dyn Fn(&StoneRow) -> Value| stones.iter().map(of).collect::<Vec<_>>();
    let motion = |unit: f64, of: fn(&RowMotion) -> f64| {
        column(&|s: &StoneRow| s.motion.as_ref().map_or(Value::Null, |m| whole(of(m), unit)))
    };
    let flag = |of: fn(&RowMotion) -> bool| {
        column(&|s: &StoneRow| json!(u8::from(s.motion.as_ref().is_some_and(of))))
    };
    let limit = |of: fn(&RowMotion) -> f64, unit: f64| {
        let values = Sorted::new(facts.measured.iter().map(|(_, m)| of(m)));
        nice_above(values.quantile(0.98).unwrap_or(0.0) / unit)
    };
    let component = component_limit_m * 1e3;
    let [diverging, sequential] = colours();
    json!({
        "diverging": diverging,
        "sequential": sequential,
        "limits": {
            "along": component, "up": component, "out": component,
            "norm": limit(|m| m.displacement.norm(), 1e-3),
            "relative": limit(|m| m.relative.norm(), 1e-3),
            "limit": limit(|m| m.detection_limit_m, 1e-3),
            "rotation": limit(|m| m.rotation.norm(), 1e-3),
            "confidence": 100,
        },
        "words": Status::ALL.map(Status::word),
        "meanings": Status::ALL.map(Status::meaning),
        "id": column(&|s| json!(s.stone_id)),
        "state": column(&|s| json!(Status::ALL.iter().position(|w| *w == s.status))),
        "match": column(&|s| json!(s.matched_id)),
        "area": column(&|s| whole(s.area_m2, 1e-4)),
        "points": column(&|s| json!([s.points_1, s.points_2])),
        "photos": column(&|s| json!(s.photos)),
        "confidence": column(&|s| whole(s.confidence, 0.01)),
        "along": motion(1e-5, |m| m.face.x),
        "up": motion(1e-5, |m| m.face.y),
        "out": motion(1e-5, |m| m.face.z),
        "relative": motion(1e-5, |m| m.relative.norm()),
        "limit": motion(1e-5, |m| m.detection_limit_m),
        "rotation": motion(1e-5, |m| m.rotation.norm()),
        "significant": flag(|m| m.significant),
        "loose": flag(|m| m.loose),
        "rings": stones.iter().map(|s| ring(&results.unrolled(s))).collect::<Vec<_>>(),
    })
}

/// First vertex, then steps, whole millimetres; empty where a coordinate is not finite.
fn ring(vertices: &[Point2<f64>]) -> Vec<i64> {
    if vertices.iter().any(|p| !p.x.is_finite() || !p.y.is_finite()) {
        return Vec::new();
    }
    let mut last = [0, 0];
    let mut out = Vec::with_capacity(2 * vertices.len());
    for p in vertices {
        let next = [(p.x * 1e3).round() as i64, (p.y * 1e3).round() as i64];
        out.extend([next[0] - last[0], next[1] - last[1]]);
        last = next;
    }
    out
}

//! The part of the page that answers to mouse, touch and keyboard; without scripts the page is whole without
//! it.
//!
//! The program lies in `web/` (TypeScript) and is embedded as one bundle. Its data are a small JSON document
//! and blocks of packed columns ([`Block`]), so that a wall of 10,000 stones stays small and opens at once.

use super::block::Block;
use super::excerpts;
use super::pair::{epoch_names, known_translation_mm};
use super::tracked;
use crate::summary::Summary;
use crate::texts::fill;
use nalgebra::{Point2, Point3, Vector3};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;
use stonewise_base::error::Error;
use stonewise_core::geometry::FaceFrame;
use stonewise_figure::{colours, nice_above};
use stonewise_results::Comparison;
use stonewise_results::records::DatumState;
use stonewise_results::{Joint, JointMotion, ResultSet, RowMotion, Sorted, Status, StoneRow, Term};

/// The program; `web/README.md` says how it is built from its sources.
pub(crate) const SCRIPT: &str = include_str!("../../assets/report.js");
/// Its style sheet.
pub(crate) const STYLE: &str = include_str!("../../assets/report.css");

/// Where the program puts its views; hidden until it starts.
pub(super) const PLACE: &str = "<div id=\"explore\" hidden></div>\n";

/// Steps in which the page keeps motions and places.
const MICROMETRE: f64 = 1e-6;
const MILLIMETRE: f64 = 1e-3;
const TENTH_MM: f64 = 1e-4;

/// Data of the program, as elements for the end of the page.
pub(super) fn data(
    results: &ResultSet,
    facts: &Summary,
    compared: &Comparison,
    joints: &[Joint],
) -> Result<String, Error> {
    let mut blocks = vec![
        ("stones", stones(results, facts, compared)),
        ("joints", joint_block(joints, &origin(results))),
        ("change", change(results)),
    ];
    blocks.extend(excerpts::blocks(results, &origin(results)));
    blocks.extend(tracked::block(results).map(|block| ("tracks", block)));
    let mut lists = Map::new();
    let mut texts = excerpts::pictures(results) + &tracked::pictures(results);
    for (name, block) in blocks {
        let (columns, text) = block
            .finish()
            .map_err(Error::io("packing the report's data", Path::new("report")))?;
        lists.insert(name.to_owned(), columns);
        let _ = writeln!(
            texts,
            "<script type=\"text/plain\" id=\"block-{name}\">{text}</script>"
        );
    }
    let document = document(results, facts, joints, lists).to_string();
    // Inside a script element only the end tag could do harm; no "<" is left at all.
    let document = document.replace('<', "\\u003c");
    Ok(format!(
        "<script type=\"application/json\" id=\"report-data\">{document}</script>\n{texts}"
    ))
}

fn document(results: &ResultSet, facts: &Summary, joints: &[Joint], blocks: Map<String, Value>) -> Value {
    let limit = |of: fn(&RowMotion) -> f64| {
        let values = Sorted::new(facts.measured.iter().map(|(_, m)| of(m)));
        nice_above(values.quantile(0.98).unwrap_or(0.0) * 1e3)
    };
    let openings = joints.iter().filter_map(|j| j.motion).map(|m| m.opening_m.abs());
    let component = facts.component_limit_m * 1e3;
    let names = results
        .run
        .as_ref()
        .and_then(|run| epoch_names(run, results.pair));
    let texts = facts.texts;
    let [diverging, sequential] = colours();
    json!({
        "epochs": names.unwrap_or_else(|| {
            [1, results.pair + 1].map(|n| fill(texts.sections.epoch, &[("n", &*n.to_string())]))
        }),
        "statuses": Status::ALL.map(|s| json!({ "word": s.word(), "meaning": texts.status(s) })),
        "colours": { "diverging": diverging, "sequential": sequential },
        "limits": {
            "component": component,
            "norm": limit(|m| m.displacement.norm()),
            "relative": limit(|m| m.relative.norm()),
            "limit": limit(|m| m.detection_limit_m),
            "rotation": limit(|m| m.rotation.norm()),
            "opening": nice_above(Sorted::new(openings).quantile(0.98).unwrap_or(0.0) * 1e3),
        },
        "sound": facts.verdict.is_sound(),
        "registrationKnown": results.datum().is_some_and(|d| d.state != DatumState::Unknown),
        "terms": terms(results).iter().map(|term| texts.terms[*term as usize]).collect::<Vec<_>>(),
        "truth": known_translation_mm(results),
        "blocks": blocks,
        "cameras": excerpts::cameras(results, &origin(results)),
        "crops": excerpts::crops(results),
        "tracks": tracked::layout(results),
    })
}

/// World origin of the page's coordinates: a whole metre near the first stone.
fn origin(results: &ResultSet) -> Point3<f64> {
    let finite = |s: &&StoneRow| s.centroid.iter().all(|v| v.is_finite());
    let first = results.stones.iter().find(finite);
    first.map_or(Point3::origin(), |s| s.centroid.map(f64::round))
}

/// One row for each stone; rings as (along, up) from the stone's place, their vertices in a column of their
/// own.
fn stones(results: &ResultSet, facts: &Summary, compared: &Comparison) -> Block {
    let rows = &results.stones;
    let mut block = Block::default();
    block.u32("id", rows.iter().map(|s| s.stone_id));
    block.u8("state", rows.iter().map(|s| s.status as u8));
    block.u32("partner", rows.iter().map(|s| s.matched_id.unwrap_or(0)));
    block.i32("area", TENTH_MM, rows.iter().map(|s| s.area_m2));
    block.u32("points1", rows.iter().map(|s| s.points_1));
    block.u32("points2", rows.iter().map(|s| s.points_2.unwrap_or(0)));
    block.u16(
        "photos",
        1.0,
        rows.iter().map(|s| u16::try_from(s.photos).unwrap_or(u16::MAX)),
    );
    block.i8("confidence", 0.01, rows.iter().map(|s| s.confidence));
    motions(results, facts, &mut block);
    block.i32(
        "m3c2",
        MICROMETRE,
        compared.on_stone.iter().map(|d| d.unwrap_or(f64::NAN)),
    );
    let centroid = |axis: usize| rows.iter().map(move |s| s.centroid[axis] - origin(results)[axis]);
    ["x", "y", "z"]
        .into_iter()
        .enumerate()
        .for_each(|(k, name)| block.i32(name, TENTH_MM, centroid(k)));
    let normals: Vec<Vector3<f64>> = rows.iter().map(|s| results.normal(s)).collect();
    for (k, name) in ["nx", "ny", "nz"].into_iter().enumerate() {
        block.i16(name, 1.0 / 32_767.0, normals.iter().map(|n| n[k]));
    }
    let places: Vec<Point2<f64>> = rows.iter().map(|s| results.facade.place(&s.centroid)).collect();
    block.i32("a", MILLIMETRE, places.iter().map(|p| p.x));
    block.i32("u", MILLIMETRE, places.iter().map(|p| p.y));
    let mut ends = Vec::with_capacity(rows.len());
    let mut vertices: Vec<f64> = Vec::new();
    for (stone, place) in rows.iter().zip(&places) {
        let ring = results.unrolled(stone);
        if ring.iter().all(|p| p.x.is_finite() && p.y.is_finite()) {
            vertices.extend(ring.iter().flat_map(|p| [p.x - place.x, p.y - place.y]));
        }
        ends.push((vertices.len() / 2) as u32);
    }
    block.u32("ringEnd", ends);
    block.i16("ring", MILLIMETRE, vertices);
    block
}

/// Columns of what was measured: motions, their covariances and rotations in the face frame (along, up, out).
fn motions(results: &ResultSet, facts: &Summary, block: &mut Block) {
    let rows = &results.stones;
    let of = |pick: &dyn Fn(&StoneRow, &RowMotion) -> f64| -> Vec<f64> {
        let value = |s: &StoneRow| s.motion.as_ref().map_or(f64::NAN, |m| pick(s, m));
        rows.iter().map(value).collect()
    };
    let in_face = |s: &StoneRow, world: &Vector3<f64>| {
        FaceFrame::from_normal(&results.normal(s)).face_from_world() * world
    };
    for (k, axis) in ["Along", "Up", "Out"].into_iter().enumerate() {
        block.i32(&format!("d{axis}"), MICROMETRE, of(&|_, m| m.face[k]));
        block.i32(
            &format!("rel{axis}"),
            MICROMETRE,
            of(&|s, m| in_face(s, &m.relative)[k]),
        );
        block.i32(
            &format!("rot{axis}"),
            MICROMETRE,
            of(&|s, m| in_face(s, &m.rotation)[k]),
        );
    }
    // Standard deviations and correlations survive quantisation better than covariances.
    let sigma = |s: &StoneRow, m: &RowMotion, k: usize| results.face_covariance(s, m)[(k, k)].max(0.0).sqrt();
    for (k, axis) in ["Along", "Up", "Out"].into_iter().enumerate() {
        block.i32(&format!("sigma{axis}"), MICROMETRE, of(&|s, m| sigma(s, m, k)));
    }
    for (n, term) in terms(results).into_iter().enumerate() {
        for (k, axis) in ["Along", "Up", "Out"].into_iter().enumerate() {
            let sd = |m: &RowMotion| m.budget.variances(term)[k].max(0.0).sqrt();
            block.i32(&format!("term{n}{axis}"), MICROMETRE, of(&|_, m| sd(m)));
        }
    }
    for (name, i, j) in [("corAlongUp", 0, 1), ("corAlongOut", 0, 2), ("corUpOut", 1, 2)] {
        let correlation = |s: &StoneRow, m: &RowMotion| {
            results.face_covariance(s, m)[(i, j)] / (sigma(s, m, i) * sigma(s, m, j))
        };
        block.i16(name, 1.0 / 32_767.0, of(&correlation));
    }
    block.i32("limit", MICROMETRE, of(&|_, m| m.detection_limit_m));
    block.i8("observability", 0.01, of(&|_, m| m.observability));
    let flag = |of: fn(&RowMotion) -> bool| {
        rows.iter()
            .map(move |s| u8::from(s.motion.as_ref().is_some_and(of)))
    };
    // Which stones are above their limit, moved or are loose, a run in doubt cannot tell: it sets none apart.
    let sound = facts.verdict.is_sound();
    let significant = move |m: &RowMotion| m.significant || !sound;
    block.u8(
        "significant",
        rows.iter()
            .map(|s| u8::from(s.motion.as_ref().is_some_and(significant))),
    );
    let moved: BTreeSet<u32> = facts.moved.iter().map(|(s, _)| s.stone_id).collect();
    block.u8(
        "moved",
        rows.iter()
            .map(|s| u8::from(sound && moved.contains(&s.stone_id))),
    );
    block.u8("loose", flag(|m| m.loose).map(|loose| loose * u8::from(sound)));
}

/// The terms of the budgets.
fn terms(results: &ResultSet) -> Vec<Term> {
    let motions = results.stones.iter().filter_map(|s| s.motion.as_ref());
    let all: BTreeSet<Term> = motions
        .flat_map(|m| m.budget.sds().map(|(term, _)| term))
        .collect();
    all.into_iter().collect()
}

/// Joints with their ends on the unrolled wall and in the world.
fn joint_block(joints: &[Joint], origin: &Point3<f64>) -> Block {
    let mut block = Block::default();
    block.u32("first", joints.iter().map(|j| j.stones[0] as u32));
    block.u32("second", joints.iter().map(|j| j.stones[1] as u32));
    for (k, end) in ["1", "2"].into_iter().enumerate() {
        block.i32(&format!("a{end}"), MILLIMETRE, joints.iter().map(|j| j.line[k].x));
        block.i32(&format!("u{end}"), MILLIMETRE, joints.iter().map(|j| j.line[k].y));
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let place = joints.iter().map(|j| j.world[k][axis] - origin[axis]);
            block.i32(&format!("{name}{end}"), MILLIMETRE, place);
        }
    }
    block.i16("width", TENTH_MM, joints.iter().map(|j| j.width_m));
    let of = |pick: fn(&JointMotion) -> f64| {
        joints
            .iter()
            .map(move |j| j.motion.as_ref().map_or(f64::NAN, pick))
    };
    block.i32("opening", MICROMETRE, of(|m| m.opening_m));
    block.i32("sliding", MICROMETRE, of(|m| m.sliding_m));
    block.i32("step", MICROMETRE, of(|m| m.step_m));
    block.i32("sigma", MICROMETRE, of(|m| m.opening_sigma_m));
    block
}

/// M3C2 core points on the unrolled wall.
fn change(results: &ResultSet) -> Block {
    let mut block = Block::default();
    let places: Vec<Point2<f64>> = results
        .distances
        .iter()
        .map(|p| results.facade.place(&p.position))
        .collect();
    block.i32("a", MILLIMETRE, places.iter().map(|p| p.x));
    block.i32("u", MILLIMETRE, places.iter().map(|p| p.y));
    block.i32(
        "distance",
        MICROMETRE,
        results.distances.iter().map(|p| p.distance_m),
    );
    block.i32(
        "limit",
        MICROMETRE,
        results.distances.iter().map(|p| p.detection_limit_m),
    );
    block
}

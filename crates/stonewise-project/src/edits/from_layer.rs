//! Edits from the layer `stones_facade` of a GeoPackage that a person changed: what differs from the results.

use super::edits_file::{Action, Edit};
use super::signed::Signed;
use nalgebra::Point2;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use stonewise_base::error::Result;
use stonewise_core::geometry::{ring_contains, signed_area};
use stonewise_io::layers::read_polygons;
use stonewise_results::ResultSet;

/// The layer that is edited.
const LAYER: &str = "stones_facade";
/// The word in the attribute `status` of a polygon that is an area to be ignored.
const IGNORE: &str = "ignore";
/// Samples along either side of a box in which shapes are compared: areas within a few per cent.
const SAMPLES: usize = 100;
/// Shapes that have this share of their union in common are the same: one moved vertex of many, or none.
const SAME: f64 = 0.98;
/// A shape that has more than this share of another holds it.
const HELD: f64 = 0.5;

type Ring = Vec<Point2<f64>>;

/// A polygon of the edited layer.
struct Shape {
    fid: i64,
    /// The stone whose attributes it carries.
    stone: Option<u32>,
    rings: Vec<Ring>,
    attributes: BTreeMap<String, String>,
}

/// The edits that turn the stones of the results into the polygons of the layer, and notes about polygons.
pub(super) fn edits(path: &Path, results: &ResultSet, signed: &Signed) -> Result<(Vec<Edit>, Vec<String>)> {
    let known: BTreeMap<u32, Stone> = results
        .stones
        .iter()
        .map(|row| {
            let stone = Stone {
                place: [row.along_m, row.up_m],
                rings: vec![results.unrolled(row)],
            };
            (row.stone_id, stone)
        })
        .collect();
    let mut notes = Vec::new();
    let mut shapes = Vec::new();

    for feature in read_polygons(path, LAYER)? {
        let holes: usize = feature.polygons.iter().map(|p| p.len().saturating_sub(1)).sum();
        if holes > 0 {
            notes.push(format!("feature {}: its {holes} holes are filled", feature.fid));
        }
        let outer = feature.polygons.into_iter().filter_map(|p| p.into_iter().next());
        let ring = |r: Vec<[f64; 2]>| r.into_iter().map(Point2::from).collect();
        let stone = feature.attributes.get("stone_id").and_then(|s| s.parse().ok());
        shapes.push(Shape {
            fid: feature.fid,
            stone: stone.filter(|s| known.contains_key(s)),
            rings: outer.map(ring).filter(|r: &Ring| r.len() > 2).collect(),
            attributes: feature.attributes,
        });
    }

    let mut comparison = Comparison {
        known: &known,
        shapes: &shapes,
        signed,
        edits: Vec::new(),
    };
    comparison.compare();
    Ok((comparison.edits, notes))
}

/// A stone of the results.
struct Stone {
    place: [f64; 2],
    rings: Vec<Ring>,
}

struct Comparison<'a> {
    known: &'a BTreeMap<u32, Stone>,
    shapes: &'a [Shape],
    signed: &'a Signed,
    edits: Vec<Edit>,
}

impl Comparison<'_> {
    fn compare(&mut self) {
        let (known, shapes) = (self.known, self.shapes);
        let is_area = |s: &&Shape| {
            s.attributes
                .get("status")
                .is_some_and(|w| w.eq_ignore_ascii_case(IGNORE))
        };
        let (areas, stones): (Vec<&Shape>, Vec<&Shape>) = shapes.iter().partition(is_area);
        let mut parts: BTreeMap<u32, Vec<&Shape>> = known.keys().map(|id| (*id, Vec::new())).collect();

        for shape in stones.iter().filter(|s| !s.rings.is_empty()) {
            if let Some(list) = shape.stone.and_then(|id| parts.get_mut(&id)) {
                list.push(shape);
            }
        }

        let gone: BTreeSet<u32> = parts.iter().filter(|p| p.1.is_empty()).map(|p| *p.0).collect();
        let mut taken = BTreeSet::new();
        // Stones that another polygon holds now.
        for shape in &stones {
            let mut held: BTreeSet<u32> = gone
                .iter()
                .copied()
                .filter(|id| !taken.contains(id) && share(&known[id].rings, &shape.rings) > HELD)
                .collect();
            taken.extend(&held);
            held.extend(shape.stone);
            if held.len() > 1 {
                let at = held.iter().map(|id| known[id].place).collect();
                self.push(Action::Merge, shape, at, Vec::new());
            } else if let (Some(&id), None) = (held.first(), shape.stone) {
                self.reshape(id, shape);
            }
        }

        for &id in gone.difference(&taken) {
            let anybody = self.signature(None);
            self.edits.push(Edit {
                at: vec![known[&id].place],
                ..anybody.edit(Action::Delete)
            });
        }

        let merged: BTreeSet<i64> = stones
            .iter()
            .filter(|s| taken.iter().any(|id| share(&known[id].rings, &s.rings) > HELD))
            .map(|s| s.fid)
            .collect();
        for (id, parts) in &parts {
            self.compare_parts(*id, parts, &stones, &merged);
        }

        for shape in stones
            .iter()
            .filter(|s| s.stone.is_none() && !merged.contains(&s.fid))
        {
            let within = known
                .iter()
                .find(|(id, stone)| !gone.contains(id) && share(&shape.rings, &stone.rings) > HELD);
            let action = if within.is_some() {
                Action::Split
            } else {
                Action::Add
            };
            self.push_outlines(action, shape);
        }

        for shape in areas {
            self.push_outlines(Action::Ignore, shape);
        }
    }

    /// The polygons that carry the attributes of one stone.
    fn compare_parts(&mut self, id: u32, parts: &[&Shape], stones: &[&Shape], merged: &BTreeSet<i64>) {
        let stone = &self.known[&id];
        match parts {
            [] => {}
            [shape] if merged.contains(&shape.fid) || is_same(&stone.rings, &shape.rings) => {}
            [shape] => {
                // What it lost may be a polygon of its own.
                let is_part = |s: &&&Shape| s.stone.is_none() && share(&s.rings, &stone.rings) > HELD;
                if !stones.iter().any(|s| is_part(&s)) {
                    self.reshape(id, shape);
                }
            }
            parts => {
                let area = |s: &Shape| s.rings.iter().map(|r| signed_area(r).abs()).sum::<f64>();
                let largest = parts
                    .iter()
                    .copied()
                    .reduce(|a, b| if area(b) > area(a) { b } else { a });
                for part in parts.iter().filter(|p| Some(p.fid) != largest.map(|l| l.fid)) {
                    self.push_outlines(Action::Split, part);
                }
            }
        }
    }

    /// Another outline: the stone goes, and one with the new outline comes.
    fn reshape(&mut self, id: u32, shape: &Shape) {
        let stone = &self.known[&id];
        if !is_same(&stone.rings, &shape.rings) {
            self.push(Action::Delete, shape, vec![stone.place], Vec::new());
            self.push_outlines(Action::Add, shape);
        }
    }

    fn push_outlines(&mut self, action: Action, shape: &Shape) {
        for ring in &shape.rings {
            self.push(
                action,
                shape,
                Vec::new(),
                ring.iter().map(|p| [p.x, p.y]).collect(),
            );
        }
    }

    fn push(&mut self, action: Action, shape: &Shape, at: Vec<[f64; 2]>, outline: Vec<[f64; 2]>) {
        let edit = self.signature(Some(shape)).edit(action);
        self.edits.push(Edit { at, outline, ..edit });
    }

    /// Who, when and why: attributes of those names where a person added them to the layer.
    fn signature(&self, shape: Option<&Shape>) -> Signed {
        let text = |key: &str, or: &str| {
            let own = shape
                .and_then(|s| s.attributes.get(key))
                .filter(|t| !t.trim().is_empty());
            own.map_or(or.to_owned(), Clone::clone)
        };
        Signed {
            who: text("who", &self.signed.who),
            when: text("when", &self.signed.when),
            why: text("why", &self.signed.why),
        }
    }
}

fn contains(rings: &[Ring], p: &Point2<f64>) -> bool {
    rings.iter().any(|r| ring_contains(r, p))
}

/// Samples in the box around rings.
fn samples(rings: &[Ring]) -> Vec<Point2<f64>> {
    let all = || rings.iter().flatten().copied();
    let (Some(low), Some(high)) = (all().reduce(|a, b| a.inf(&b)), all().reduce(|a, b| a.sup(&b))) else {
        return Vec::new();
    };
    let at = |i: usize| (i as f64 + 0.5) / SAMPLES as f64;
    let place = |i: usize, j: usize| low + (high - low).component_mul(&nalgebra::Vector2::new(at(i), at(j)));
    (0..SAMPLES)
        .flat_map(|i| (0..SAMPLES).map(move |j| (i, j)))
        .map(|(i, j)| place(i, j))
        .collect()
}

/// Share of a shape that another covers.
fn share(of: &[Ring], by: &[Ring]) -> f64 {
    if !boxes_meet(of, by) {
        return 0.0;
    }
    let own: Vec<Point2<f64>> = samples(of).into_iter().filter(|p| contains(of, p)).collect();
    let both = own.iter().filter(|p| contains(by, p)).count();
    both as f64 / own.len().max(1) as f64
}

fn is_same(a: &[Ring], b: &[Ring]) -> bool {
    let vertices = |rings: &[Ring]| rings.iter().map(Vec::len).collect::<Vec<_>>();
    let close = |(p, q): (&Point2<f64>, &Point2<f64>)| (p - q).norm() < 1e-6;
    if vertices(a) == vertices(b) && a.iter().flatten().zip(b.iter().flatten()).all(close) {
        return true;
    }
    let [ab, ba] = [share(a, b), share(b, a)];
    // Of areas A and B with intersection I: ab = I / A, ba = I / B, and I / union follows from both.
    let union = 1.0 / ab + 1.0 / ba - 1.0;
    union.is_finite() && 1.0 / union >= SAME
}

fn boxes_meet(a: &[Ring], b: &[Ring]) -> bool {
    let low = |r: &[Ring]| r.iter().flatten().copied().reduce(|a, b| a.inf(&b));
    let high = |r: &[Ring]| r.iter().flatten().copied().reduce(|a, b| a.sup(&b));
    match (low(a), high(a), low(b), high(b)) {
        (Some(la), Some(ha), Some(lb), Some(hb)) => {
            la.x <= hb.x && lb.x <= ha.x && la.y <= hb.y && lb.y <= ha.y
        }
        _ => false,
    }
}

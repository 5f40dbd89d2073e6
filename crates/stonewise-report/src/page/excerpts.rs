//! Excerpts of the survey, packed for the page: crops, sections, thinned clouds, cameras.

use super::block::Block;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use nalgebra::{Point3, Vector3};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write;
use stonewise_results::{Cut, ResultSet, SectionPoint, ThinPoint};

const MILLIMETRE: f64 = 1e-3;
const TENTH_MM: f64 = 1e-4;
/// Step of outlines in crops, pixels.
const TENTH_PX: f64 = 0.1;

/// Blocks of what there is; `origin`: of the page's world coordinates.
pub(super) fn blocks(results: &ResultSet, origin: &Point3<f64>) -> Vec<(&'static str, Block)> {
    let evidence = &results.evidence;
    let mut blocks = Vec::new();
    if !evidence.sections.is_empty() {
        blocks.push(("sections", sections(results)));
    }
    for (name, points) in ["cloud1", "cloud2"].into_iter().zip(&evidence.clouds) {
        if !points.is_empty() {
            blocks.push((name, cloud(points, origin)));
        }
    }
    for (epoch, name) in ["crops1", "crops2"].into_iter().enumerate() {
        if evidence.crops[epoch].is_some() {
            blocks.push((name, crop_block(results, epoch)));
        }
    }
    blocks
}

/// Sections stone by stone in the order of the rows, four runs each: first epoch level and upright, later
/// epoch level and upright. `end`: where each run ends.
fn sections(results: &ResultSet) -> Block {
    let run = |p: &SectionPoint| 2 * usize::from(p.is_later) + usize::from(p.cut == Cut::Upright);
    let mut by_stone: BTreeMap<u32, [Vec<&SectionPoint>; 4]> = BTreeMap::new();
    for point in &results.evidence.sections {
        by_stone.entry(point.stone_id).or_default()[run(point)].push(point);
    }
    let mut ends = Vec::new();
    let mut points: Vec<&SectionPoint> = Vec::new();
    for stone in &results.stones {
        for run in by_stone.remove(&stone.stone_id).unwrap_or_default() {
            points.extend(run);
            ends.push(points.len() as u32);
        }
    }
    let mut block = Block::default();
    block.u32("end", ends);
    block.i16("place", TENTH_MM, points.iter().map(|p| f64::from(p.place_m)));
    block.i16("out", TENTH_MM, points.iter().map(|p| f64::from(p.out_m)));
    block
}

fn cloud(points: &[ThinPoint], origin: &Point3<f64>) -> Block {
    let mut block = Block::default();
    for (k, name) in ["x", "y", "z"].into_iter().enumerate() {
        block.i32(name, MILLIMETRE, points.iter().map(|p| p.position[k] - origin[k]));
    }
    for (k, name) in ["red", "green", "blue"].into_iter().enumerate() {
        block.u8(name, points.iter().map(|p| p.colour[k]));
    }
    block
}

/// Crops in the order of their places in the pictures, with the row of their stone.
fn crop_block(results: &ResultSet, epoch: usize) -> Block {
    let mut block = Block::default();
    let Some(stored) = &results.evidence.crops[epoch] else {
        return block;
    };
    let rows: BTreeMap<u32, u32> = results
        .stones
        .iter()
        .zip(0..)
        .map(|(s, i)| (s.stone_id, i))
        .collect();
    let names = photo_names(results, epoch);
    let photo = |name: &String| names.iter().position(|n| *n == name).unwrap_or(0);
    block.u32(
        "stone",
        stored
            .crops
            .iter()
            .map(|c| rows.get(&c.stone_id).copied().unwrap_or(u32::MAX)),
    );

    block.u32("photo", stored.crops.iter().map(|c| photo(&c.photo) as u32));
    block.i16("half", MILLIMETRE, stored.crops.iter().map(|c| c.half_m));
    let rings = stored.crops.iter().scan(0u32, |end, c| {
        *end += c.rings.len() as u32;
        Some(*end)
    });
    block.u32("ringsEnd", rings);
    let ends = stored
        .crops
        .iter()
        .flat_map(|c| &c.rings)
        .scan(0u32, |end, ring| {
            *end += ring.len() as u32;
            Some(*end)
        });

    block.u32("ringEnd", ends);
    let vertices = stored.crops.iter().flat_map(|c| &c.rings).flatten().flatten();
    block.i16("ring", TENTH_PX, vertices.map(|v| f64::from(*v)));
    block
}

/// Names of the photos that crops come from, in alphabetical order.
fn photo_names(results: &ResultSet, epoch: usize) -> Vec<&String> {
    let crops = results.evidence.crops[epoch].iter().flat_map(|s| &s.crops);
    let mut names: Vec<&String> = crops.map(|c| &c.photo).collect();
    names.sort();
    names.dedup();
    names
}

/// How the pictures are laid out, for both epochs; null where there are none.
pub(super) fn crops(results: &ResultSet) -> Value {
    let of = |epoch: usize| {
        results.evidence.crops[epoch].as_ref().map(|stored| {
            json!({
                "side": stored.side_px,
                "perRow": stored.per_row,
                "photos": photo_names(results, epoch),
                "atlases": stored.pictures.len(),
            })
        })
    };
    json!([of(0), of(1)])
}

/// The pictures as elements of the page.
pub(super) fn pictures(results: &ResultSet) -> String {
    let mut out = String::new();
    for (epoch, stored) in results.evidence.crops.iter().enumerate() {
        for (number, picture) in stored.iter().flat_map(|s| &s.pictures).enumerate() {
            let text = STANDARD.encode(picture);
            let _ = writeln!(
                out,
                "<script type=\"text/plain\" id=\"crops-{}-{number}\">{text}</script>",
                epoch + 1
            );
        }
    }
    out
}

/// Places and frames of the cameras of both epochs, millimetres precise.
pub(super) fn cameras(results: &ResultSet, origin: &Point3<f64>) -> Value {
    let round = |v: Vector3<f64>| -> [f64; 3] { v.map(|c| (c * 1e3).round() / 1e3).into() };
    let of = |epoch: usize| {
        results.evidence.cameras[epoch].iter().map(move |photo| {
            json!({
                "epoch": epoch + 1,
                "name": photo.name,
                "centre": round(photo.centre - origin),
                "axis": round(photo.axis),
                "right": round(photo.right),
                "down": round(photo.down),
            })
        })
    };
    of(0).chain(of(1)).collect()
}

//! Points of every matched stone along two lines through its middle.

use super::window::Window;
use crate::error::Result;
use crate::pipeline::context::Context;
use crate::pipeline::steps::label::Labelled;
use crate::results::{Cut, SectionPoint, StoneRow};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use stonewise_core::cloud::TileSource;
use stonewise_core::epoch::Pair;

/// Points of all sections together, at most about: 6 MB in the report.
const BUDGET: usize = 1_600_000;
/// Fewest and most points of one section of one epoch.
const POINTS: [usize; 2] = [40, 160];
/// Widest strip beside a line whose points belong to the section, metres.
const MAX_STRIP_M: f64 = 0.02;

/// What is looked for near a stone.
struct Search<'a> {
    window: &'a Window,
    /// Where the lines cross, from the centre of the window, in the face frame.
    shift: Vector3<f64>,
    /// Half the width of the strips, metres.
    strip_m: f64,
}

/// Sections of the measured stones, sorted by stone, epoch, cut and place.
pub fn sections(
    context: &Context,
    epochs: Pair<&Labelled>,
    windows: &[Window],
    rows: &[StoneRow],
) -> Result<Vec<SectionPoint>> {
    let wanted = (BUDGET / (4 * rows.len().max(1))).clamp(POINTS[0], POINTS[1]);
    let by_id: BTreeMap<u32, &Window> = windows.iter().map(|w| (w.stone_id, w)).collect();
    let mut points = Vec::new();

    for (later, epoch) in epochs.into_iter().enumerate() {
        let mut searches: BTreeMap<u32, Search> = BTreeMap::new();
        for row in rows {
            let (Some(window), Some(partner)) = (by_id.get(&row.stone_id), row.matched_id) else {
                continue;
            };
            let moved = row.motion.as_ref().map_or(Vector3::zeros(), |m| m.face);
            let search = Search {
                window,
                shift: if later == 0 { Vector3::zeros() } else { moved },
                strip_m: (wanted as f64 / (window.density * 4.0 * window.half_m)).min(MAX_STRIP_M),
            };
            searches.insert(if later == 0 { row.stone_id } else { partner }, search);
        }
        gather(context, epoch, later == 1, &searches, &mut points)?;
    }

    let key = |p: &SectionPoint| (p.stone_id, p.is_later, p.cut == Cut::Upright);
    points.sort_by(|a, b| key(a).cmp(&key(b)).then(a.place_m.total_cmp(&b.place_m)));
    Ok(points
        .chunk_by(|a, b| key(a) == key(b))
        .flat_map(|p| thinned(p, wanted))
        .collect())
}

/// Evenly chosen points, `most` at most.
fn thinned(points: &[SectionPoint], most: usize) -> Vec<SectionPoint> {
    let kept = points.len().min(most);
    (0..kept).map(|i| points[i * points.len() / kept]).collect()
}

/// Adds the points of an epoch that lie in the strips of their stones.
fn gather(
    context: &Context,
    epoch: &Labelled,
    is_later: bool,
    searches: &BTreeMap<u32, Search>,
    points: &mut Vec<SectionPoint>,
) -> Result<()> {
    let tiles = &epoch.ingested.tiles;
    let of_tile = |tile| -> Result<Vec<SectionPoint>> {
        let mut points = Vec::new();
        let labels = epoch.labels(tile)?;
        if labels.stone.iter().any(|s| searches.contains_key(s)) {
            let cloud = tiles.load(tile)?;
            for (i, stone) in labels.stone.iter().enumerate() {
                let Some(search) = searches.get(stone) else {
                    continue;
                };
                let local = search.window.frame.face_from_world() * (cloud.world(i) - search.window.centre);
                let off = local - search.shift;
                let mut add = |cut: Cut, place: f64| {
                    points.push(SectionPoint {
                        stone_id: search.window.stone_id,
                        is_later,
                        cut,
                        place_m: place as f32,
                        out_m: local.z as f32,
                    });
                };
                if off.y.abs() <= search.strip_m {
                    add(Cut::Level, local.x);
                }
                if off.x.abs() <= search.strip_m {
                    add(Cut::Upright, local.y);
                }
            }
        }
        Ok(points)
    };
    context
        .progress
        .each_prepared("sections", 0..tiles.tile_count(), of_tile, |_, found| {
            points.extend(found);
            Ok(())
        })
}

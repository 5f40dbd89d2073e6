//! The stones for ParaView: outlines and centroids with all numbers.

use crate::{ResultSet, RowMotion, STONE_COLUMNS, StoneRow};
use nalgebra::Vector3;
use stonewise_io::layers::PolyData;

/// One of the vectors of a motion.
type VectorOf = fn(&RowMotion) -> Vector3<f64>;

/// Numbers and vectors of all stones: every column of the stone table, the status as its place in the order
/// of reports, and the vectors once more as such.
fn attributes(data: &mut PolyData, stones: &[&StoneRow]) {
    for column in STONE_COLUMNS {
        let number = |s: &&StoneRow| column.number(s).unwrap_or_else(|| f64::from(s.status as u8));
        let values = stones.iter().map(number).collect();
        data.scalars.push((column.name.to_owned(), values));
    }
    let vectors: [(&str, VectorOf); 3] = [
        ("displacement", |m| m.displacement),
        ("rotation", |m| m.rotation),
        ("against_neighbours", |m| m.relative),
    ];
    for (name, of) in vectors {
        let vector = |s: &&StoneRow| s.motion.as_ref().map_or([f64::NAN; 3], |m| of(m).into());
        data.vectors
            .push((name.to_owned(), stones.iter().map(vector).collect()));
    }
}

/// The stones' outlines as polygons.
pub(super) fn face_polygons(results: &ResultSet) -> PolyData {
    let mut data = PolyData::default();
    let mut drawn = Vec::new();
    for stone in &results.stones {
        if let Some(outline) = results.outlines.get(&stone.stone_id) {
            let first = data.points.len() as u32;
            data.polygons
                .push((first..first + outline.ring.len() as u32).collect());
            data.points.extend(&outline.ring);
            drawn.push(stone);
        }
    }
    attributes(&mut data, &drawn);
    data
}

/// The centroids of the measured stones, for arrows.
pub(super) fn centroids(results: &ResultSet) -> PolyData {
    let finite = |s: &&StoneRow| s.centroid.iter().all(|v| v.is_finite());
    let stones: Vec<&StoneRow> = results
        .measured()
        .into_iter()
        .map(|(s, _)| s)
        .filter(finite)
        .collect();
    let mut data = PolyData {
        points: stones.iter().map(|s| s.centroid).collect(),
        ..PolyData::default()
    };
    // A file without stones has no arrays at all.
    if !results.stones.is_empty() {
        attributes(&mut data, &stones);
    }
    data
}

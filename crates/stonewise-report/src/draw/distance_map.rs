//! The unrolled wall with M3C2 distances.

use super::stone_map::MapLayout;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use stonewise_figure::Scale;
use stonewise_results::{ResultSet, Sorted};

/// Bounds of the edge of a square of the map, pixels.
const CELL_PX: [f64; 2] = [2.0, 12.0];
/// Edge of a square in typical distances between neighbouring core points.
const CELL_SPACINGS: f64 = 1.3;
/// How often empty squares between filled ones take their neighbours' median.
const FILLS: usize = 3;

/// Medians of the core points' distances in squares, as one SVG element; `None` without core points.
///
/// Faded squares: the median distance is below the median detection limit.
pub(crate) fn distance_map(layout: &MapLayout, results: &ResultSet, scale: Scale) -> Option<String> {
    let [left, top, width, height] = layout.axes.area;
    let inside: Vec<(f64, f64, usize)> = results
        .distances
        .iter()
        .enumerate()
        .filter_map(|(i, point)| {
            let place = results.facade.place(&point.position);
            let (x, y) = (layout.axes.px(place.x) - left, layout.axes.py(place.y) - top);
            ((0.0..width).contains(&x) && (0.0..height).contains(&y)).then_some((x, y, i))
        })
        .collect();
    let cell = (CELL_SPACINGS * spacing(&inside, width * height)).clamp(CELL_PX[0], CELL_PX[1]);
    let mut cells: BTreeMap<(i64, i64), (Vec<f64>, Vec<f64>)> = BTreeMap::new();

    for (x, y, i) in inside {
        let entry = cells.entry(((y / cell) as i64, (x / cell) as i64)).or_default();
        entry.0.push(results.distances[i].distance_m);
        entry.1.push(results.distances[i].detection_limit_m);
    }

    if cells.is_empty() {
        return None;
    }
    let mut medians: BTreeMap<(i64, i64), [f64; 2]> = BTreeMap::new();

    for (place, (distances, limits)) in cells {
        if let Some(distance) = Sorted::new(distances).median() {
            medians.insert(place, [distance, Sorted::new(limits).median().unwrap_or(0.0)]);
        }
    }

    (0..FILLS).for_each(|_| fill_gaps(&mut medians));
    let mut groups: BTreeMap<(bool, i32), String> = BTreeMap::new();
    for ((row, column), [distance, limit]) in medians {
        let shown = distance.abs() > limit;
        let path = groups.entry((shown, scale.step(distance))).or_default();
        let edge = |start: f64, i: i64| ((start + i as f64 * cell) * 10.0).round() as i64;
        let (x, y) = (edge(left, column), edge(top, row));
        let (w, h) = (edge(left, column + 1) - x, edge(top, row + 1) - y);
        let _ = write!(path, "M{x} {y}h{w}v{h}h-{w}z");
    }

    let mut out = layout.open(layout.texts().maps.m3c2);
    layout.axes.draw(&mut out);
    out.push_str(r#"<g transform="scale(.1)" shape-rendering="crispEdges">"#);

    for ((shown, step), path) in groups {
        let class = if shown { "" } else { r#" class="faded""# };
        let _ = write!(out, r#"<path{class} fill="{}" d="{path}"/>"#, scale.colour(step));
    }

    out.push_str("</g>");
    layout.draw_bar(&mut out, scale, "mm");
    out.push_str("</svg>");
    Some(out)
}

/// Typical distance between core points, pixels: the root of the area that a point has, where there are
/// points.
fn spacing(points: &[(f64, f64, usize)], area: f64) -> f64 {
    let coarse = 4.0 * (area / points.len().max(1) as f64).sqrt();
    let filled: BTreeSet<(i64, i64)> = points
        .iter()
        .map(|(x, y, _)| ((x / coarse) as i64, (y / coarse) as i64))
        .collect();
    (filled.len() as f64 * coarse * coarse / points.len().max(1) as f64).sqrt()
}

/// Gives empty squares between filled ones the median of their neighbours: core points on a grid of their own
/// leave rows of squares empty. A square needs five filled neighbours of its eight.
fn fill_gaps(squares: &mut BTreeMap<(i64, i64), [f64; 2]>) {
    let around = |(row, column): (i64, i64)| {
        (-1..=1)
            .flat_map(move |r| (-1..=1).map(move |c| (row + r, column + c)))
            .filter(move |p| *p != (row, column))
    };
    let candidates: BTreeSet<(i64, i64)> = squares
        .keys()
        .flat_map(|p| around(*p))
        .filter(|p| !squares.contains_key(p))
        .collect();
    let fill = |place: (i64, i64)| {
        let known: Vec<[f64; 2]> = around(place).filter_map(|p| squares.get(&p).copied()).collect();
        let median = |k: usize| Sorted::new(known.iter().map(|v| v[k])).median();
        (known.len() >= 5).then_some((place, [median(0)?, median(1)?]))
    };
    let filled: Vec<_> = candidates.into_iter().filter_map(fill).collect();
    squares.extend(filled);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_is_filled_and_the_border_is_not() {
        let mut squares: BTreeMap<(i64, i64), [f64; 2]> = (0..9)
            .filter(|i| *i != 4)
            .map(|i| ((i / 3, i % 3), [i as f64, 0.5]))
            .collect();
        fill_gaps(&mut squares);
        assert_eq!(squares.len(), 9);
        assert_eq!(squares[&(1, 1)], [4.0, 0.5]);
    }
}

//! Rubble: cells about scattered points, nearest by power distance.

use super::cell::{Extent, Ring, clip};
use super::draw::{Rng, between, chance};

/// Power diagram (Aurenhammer 1987) of points of several weights: large stones among small ones.
pub(super) fn lay_rubble(
    aspect: f32,
    mixture: f32,
    disorder: f32,
    size: f32,
    extent: Extent,
    rng: &mut Rng,
) -> Vec<Ring> {
    // In a frame squeezed along x, where stones are as long as high.
    let squeeze = 1.0 / aspect.sqrt();
    let frame = [
        extent[0] * squeeze,
        extent[1] / squeeze,
        extent[2] * squeeze,
        extent[3] / squeeze,
    ];
    let coarse = size * (1.0 + mixture);
    let sites = scatter(coarse, mixture, disorder, frame, rng);
    let reach = 2.2 * coarse;
    let bins = Bins::new(&sites, reach, frame);

    sites
        .iter()
        .enumerate()
        .filter_map(|(i, site)| {
            let mut ring = vec![
                [site.x - reach, site.y - reach],
                [site.x + reach, site.y - reach],
                [site.x + reach, site.y + reach],
                [site.x - reach, site.y + reach],
            ];
            for j in bins.near(site) {
                if i != j {
                    let (dx, dy) = (sites[j].x - site.x, sites[j].y - site.y);
                    let gap = dx * dx + dy * dy;
                    if gap < reach * reach && gap > 0.0 {
                        let t = 0.5 * (gap + site.weight - sites[j].weight);
                        clip(&mut ring, [dx, dy], t + dx * site.x + dy * site.y);
                    }
                }
            }
            for point in &mut ring {
                *point = [point[0] / squeeze, point[1] * squeeze];
            }
            (ring.len() >= 3).then_some(ring)
        })
        .collect()
}

/// A point of the power diagram.
struct Site {
    x: f32,
    y: f32,
    weight: f32,
}

/// Points on a staggered grid of `spacing`, each replaced by four with probability `mixture`, and those again
/// with half of it.
fn scatter(spacing: f32, mixture: f32, disorder: f32, frame: Extent, rng: &mut Rng) -> Vec<Site> {
    let mut sites = Vec::new();
    let mut y = frame[1] - spacing;
    let mut odd = false;
    while y < frame[3] + spacing {
        let mut x = frame[0] - spacing * if odd { 1.5 } else { 1.0 };
        while x < frame[2] + spacing {
            place(
                &mut sites,
                [x, y],
                spacing,
                [mixture, 0.5 * mixture],
                disorder,
                rng,
            );
            x += spacing;
        }
        y += spacing;
        odd = !odd;
    }
    sites
}

fn place(sites: &mut Vec<Site>, corner: [f32; 2], side: f32, split: [f32; 2], disorder: f32, rng: &mut Rng) {
    if chance(rng, split[0]) {
        let half = 0.5 * side;
        for (i, j) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let corner = [corner[0] + i * half, corner[1] + j * half];
            place(sites, corner, half, [split[1], 0.0], disorder, rng);
        }
        return;
    }
    let shift = 0.5 * disorder * side;
    sites.push(Site {
        x: corner[0] + 0.5 * side + between(rng, -shift, shift),
        y: corner[1] + 0.5 * side + between(rng, -shift, shift),
        weight: 0.12 * side * side * between(rng, 0.3, 1.0),
    });
}

/// Sites by square of a grid.
struct Bins {
    origin: [f32; 2],
    side: f32,
    columns: usize,
    rows: usize,
    sites: Vec<Vec<usize>>,
}

impl Bins {
    fn new(sites: &[Site], side: f32, frame: Extent) -> Self {
        let origin = [frame[0] - side, frame[1] - side];
        let columns = ((frame[2] - origin[0]) / side) as usize + 2;
        let rows = ((frame[3] - origin[1]) / side) as usize + 2;
        let mut bins = Self {
            origin,
            side,
            columns,
            rows,
            sites: vec![Vec::new(); columns * rows],
        };
        for (i, site) in sites.iter().enumerate() {
            let (c, r) = bins.square(site);
            bins.sites[r * columns + c].push(i);
        }
        bins
    }

    fn square(&self, site: &Site) -> (usize, usize) {
        let c = ((site.x - self.origin[0]) / self.side) as usize;
        let r = ((site.y - self.origin[1]) / self.side) as usize;
        (c.min(self.columns - 1), r.min(self.rows - 1))
    }

    /// Sites at most one square away.
    fn near(&self, site: &Site) -> impl Iterator<Item = usize> {
        let (c, r) = self.square(site);
        let columns = c.saturating_sub(1)..(c + 2).min(self.columns);
        (r.saturating_sub(1)..(r + 2).min(self.rows)).flat_map(move |y| {
            columns
                .clone()
                .flat_map(move |x| self.sites[y * self.columns + x].iter().copied())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::synth::cell::contains;
    use rand::SeedableRng;

    #[test]
    fn rubble_cells_are_the_nearest_points_by_power_distance() {
        let mut rng = Rng::seed_from_u64(5);
        let frame = [0.0, 0.0, 100.0, 100.0];
        let cells = lay_rubble(1.0, 0.6, 0.7, 20.0, frame, &mut rng);
        let mut rng = Rng::seed_from_u64(5);
        let sites = scatter(20.0 * 1.6, 0.6, 0.7, frame, &mut rng);
        assert!(cells.len() <= sites.len());
        for _ in 0..500 {
            let p = [between(&mut rng, 0.0, 100.0), between(&mut rng, 0.0, 100.0)];
            let power = |s: &Site| (p[0] - s.x).powi(2) + (p[1] - s.y).powi(2) - s.weight;
            let Some(nearest) = sites.iter().min_by(|a, b| power(a).total_cmp(&power(b))) else {
                continue;
            };
            let Some(cell) = cells.iter().find(|ring| contains(ring, p)) else {
                panic!("no cell holds {p:?}");
            };
            // A cell is convex, so its centre belongs to the same site.
            let centre = cell.iter().fold([0.0, 0.0], |sum, q| {
                [
                    sum[0] + q[0] / cell.len() as f32,
                    sum[1] + q[1] / cell.len() as f32,
                ]
            });
            let at_centre = |s: &Site| (centre[0] - s.x).powi(2) + (centre[1] - s.y).powi(2) - s.weight;
            let least = sites.iter().map(at_centre).fold(f32::INFINITY, f32::min);
            assert!(at_centre(nearest) - least < 1e-2);
        }
    }
}

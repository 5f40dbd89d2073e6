//! Area of a patch of scattered points.

/// Cells of the finest grid, metres.
const CELL_M: f64 = 0.005;
/// The grid is coarsened until an occupied cell holds this many points on average: 86 % of the cells inside
/// the patch are then occupied, and the closing fills the rest.
const POINTS_PER_CELL: f64 = 2.0;
/// A patch larger than this many cells to a side is measured on a coarser grid.
const MAX_SIDE: usize = 2000;
/// A patch is not measured on fewer cells than this.
const MIN_CELLS: usize = 16;
/// Rounds in which area and density are found from each other.
const ITERATIONS: usize = 5;

/// Where a stone's points fall on its face: a grid that grows with the patch.
pub(super) struct Footprint {
    cell_m: f64,
    low: [f64; 2],
    width: usize,
    height: usize,
    occupied: Vec<bool>,
    points: u32,
}

impl Footprint {
    /// An empty grid over the given range of face coordinates, metres.
    pub(super) fn new(low: [f64; 2], high: [f64; 2]) -> Self {
        let extent = (high[0] - low[0]).max(high[1] - low[1]).max(0.0);
        let cell_m = CELL_M.max(extent / MAX_SIDE as f64);
        let side = |a: usize| ((high[a] - low[a]).max(0.0) / cell_m) as usize + 1;
        let (width, height) = (side(0), side(1));
        Self {
            cell_m,
            low,
            width,
            height,
            occupied: vec![false; width * height],
            points: 0,
        }
    }

    /// Adds a point; one outside the range counts for the border cell.
    pub(super) fn add(&mut self, at: [f64; 2]) {
        let cell = |a: usize, side: usize| {
            let c = (at[a] - self.low[a]) / self.cell_m;
            (c.max(0.0) as usize).min(side - 1)
        };
        let index = cell(1, self.height) * self.width + cell(0, self.width);
        self.occupied[index] = true;
        self.points += 1;
    }

    /// Area of the patch, m^2, whatever the density of its points.
    ///
    /// Occupied cells after closing gaps of one cell, less what the cells on the border cover too much: a
    /// border cell lies half inside on average, and is found with a probability that follows from the points
    /// per cell.
    pub(super) fn area_m2(&self) -> f64 {
        let finest = Grid {
            width: self.width,
            height: self.height,
            set: self.occupied.clone(),
        };
        let enough = |grid: &Grid| f64::from(self.points) >= POINTS_PER_CELL * grid.count() as f64;
        let (mut factor, mut grid) = (1, finest.coarser(1));
        while grid.count() > MIN_CELLS && !enough(&grid) {
            factor += 1;
            grid = finest.coarser(factor);
        }
        let cell_m = self.cell_m * factor as f64;
        let closed = grid.closed();
        let (inside, border) = (closed.count() as f64, closed.border());
        let mut cells = inside;
        for _ in 0..ITERATIONS {
            let density = f64::from(self.points) / cells.max(1.0);
            let border_found = 1.0 - (1.0 - (-density).exp()) / density;
            cells = inside + border * (0.5 - border_found);
        }
        cells.max(0.0) * cell_m * cell_m
    }
}

struct Grid {
    width: usize,
    height: usize,
    set: Vec<bool>,
}

impl Grid {
    fn count(&self) -> usize {
        self.set.iter().filter(|s| **s).count()
    }

    fn get(&self, x: i64, y: i64) -> bool {
        let inside = x >= 0 && y >= 0 && x < self.width as i64 && y < self.height as i64;
        inside && self.set[y as usize * self.width + x as usize]
    }

    fn map(width: usize, height: usize, value: impl Fn(i64, i64) -> bool) -> Self {
        let set = (0..height as i64)
            .flat_map(|y| (0..width as i64).map(move |x| (x, y)))
            .map(|(x, y)| value(x, y))
            .collect();
        Self { width, height, set }
    }

    /// `factor` by `factor` cells become one.
    fn coarser(&self, factor: usize) -> Self {
        let (width, height) = (self.width.div_ceil(factor), self.height.div_ceil(factor));
        let mut set = vec![false; width * height];
        for (i, _) in self.set.iter().enumerate().filter(|s| *s.1) {
            set[i / self.width / factor * width + i % self.width / factor] = true;
        }
        Self { width, height, set }
    }

    /// Gaps of one cell filled: cells between two set ones, side by side or above each other.
    fn closed(&self) -> Self {
        Self::map(self.width, self.height, |x, y| {
            let between = |dx: i64, dy: i64| self.get(x - dx, y - dy) && self.get(x + dx, y + dy);
            self.get(x, y) || between(1, 0) || between(0, 1)
        })
    }

    /// Number of cells that the patch's outline crosses: the mean of the set cells at the border, of which a
    /// slanted outline has too few, and of their open sides, of which a ragged one has too many.
    fn border(&self) -> f64 {
        let sides = [(1, 0), (-1, 0), (0, 1), (0, -1)];
        let open = |x: i64, y: i64| sides.iter().filter(|(dx, dy)| !self.get(x + dx, y + dy)).count();
        let open_sides: Vec<usize> = (0..self.height as i64)
            .flat_map(|y| (0..self.width as i64).map(move |x| (x, y)))
            .filter(|&(x, y)| self.get(x, y))
            .map(|(x, y)| open(x, y))
            .filter(|&open| open > 0)
            .collect();
        (open_sides.len() + open_sides.iter().sum::<usize>()) as f64 / 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    fn measured(seed: u64, points: usize, inside: impl Fn(f64, f64) -> bool, area: f64) -> f64 {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut footprint = Footprint::new([-0.4, -0.4], [0.4, 0.4]);
        let mut left = points;
        while left > 0 {
            let (x, y) = (rng.random_range(-0.4..0.4), rng.random_range(-0.4..0.4));
            if inside(x, y) {
                footprint.add([x, y]);
                left -= 1;
            }
        }
        footprint.area_m2() / area
    }

    #[test]
    fn area_does_not_depend_on_density() {
        let turned = |x: f64, y: f64| {
            let (u, v) = (0.8 * x + 0.6 * y, -0.6 * x + 0.8 * y);
            u.abs() < 0.15 && v.abs() < 0.1
        };
        let disc = |x: f64, y: f64| x.hypot(y) < 0.12;
        // Spacings of 3, 5, 9 and 15 mm.
        for spacing in [0.003, 0.005, 0.009, 0.015f64] {
            for seed in 0..5 {
                let count = |area: f64| (area / (spacing * spacing)) as usize;
                let rectangle = measured(seed, count(0.06), turned, 0.06);
                let round = measured(seed, count(0.04524), disc, 0.04524);
                let tolerance = if spacing < 0.01 { 0.04 } else { 0.08 };
                assert!(
                    (rectangle - 1.0).abs() < tolerance,
                    "spacing {spacing}: {rectangle}"
                );
                assert!((round - 1.0).abs() < tolerance, "spacing {spacing}: {round}");
            }
        }
    }
}

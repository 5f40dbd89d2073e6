//! Sums over the cells of a face, in which the epochs are compared.

/// Side of the small cells in which the epochs are compared, in cells of the surface: what the surface cannot
/// follow averages out in them, and a stone of 20 cm still has some dozens.
pub(crate) const COMPARE_CELLS: f64 = 4.0;

/// Weighted residuals of both epochs in small cells, and the sums of their weights.
pub(crate) struct CellSums {
    low: [f64; 2],
    cell_m: f64,
    counts: [usize; 2],
    sums: Vec<[(f64, f64); 2]>,
}

impl CellSums {
    pub fn new(low: [f64; 2], high: [f64; 2], cell_m: f64) -> Self {
        let counts = [0, 1].map(|a| ((high[a] - low[a]) / cell_m).ceil().max(1.0) as usize);
        Self {
            low,
            cell_m,
            counts,
            sums: vec![[(0.0, 0.0); 2]; counts[0] * counts[1]],
        }
    }

    /// Number of the cell that holds a point.
    #[inline(always)]
    pub fn cell(&self, p: &[f64; 3]) -> Option<usize> {
        let at = [0, 1].map(|a| (p[a] - self.low[a]) / self.cell_m);
        let is_inside = (0..2).all(|a| at[a] >= 0.0 && at[a] < self.counts[a] as f64);
        is_inside.then(|| at[1] as usize * self.counts[0] + at[0] as usize)
    }

    /// Adds to the sums of an epoch in a cell.
    #[inline(always)]
    pub fn add(&mut self, cell: usize, epoch: usize, product: f64, weight: f64) {
        let sums = &mut self.sums[cell][epoch];
        sums.0 += product;
        sums.1 += weight;
    }

    pub fn count(&mut self, epoch: usize, p: &[f64; 3]) {
        if let Some(cell) = self.cell(p) {
            self.add(cell, epoch, 0.0, 1.0);
        }
    }

    /// Share of the cells of the larger face that hold points of both epochs.
    pub fn overlap(&self) -> f64 {
        let held = |test: fn(&[(f64, f64); 2]) -> bool| self.sums.iter().filter(|c| test(c)).count() as f64;
        let both = held(|c| c[0].1 > 0.0 && c[1].1 > 0.0);
        let larger = held(|c| c[0].1 > 0.0).max(held(|c| c[1].1 > 0.0));
        both / larger.max(1.0)
    }

    /// Per cell to which both give at least this weight: difference of the means, and its expected variance.
    pub fn differences<'a>(
        &'a self,
        sigma_m: &'a [f64; 2],
        least: f64,
    ) -> impl Iterator<Item = (f64, f64)> + 'a {
        self.sums
            .iter()
            .filter(move |c| c.iter().all(|e| e.1 >= least))
            .map(|c| {
                let d = c[1].0 / c[1].1 - c[0].0 / c[0].1;
                let variance = sigma_m[0].powi(2) / c[0].1 + sigma_m[1].powi(2) / c[1].1;
                (d, variance)
            })
    }
}

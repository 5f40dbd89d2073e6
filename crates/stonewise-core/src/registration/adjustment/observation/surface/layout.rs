//! How a stone's face is cut into patches and how its points are weighted.

/// How the face is cut and from where points count as outliers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    /// Side of a cell of the surface grid.
    pub cell_m: f64,
    /// Longest side of a patch, in cells.
    pub patch_cells: usize,
    /// Residuals beyond this many sigmas lose weight.
    pub outlier_sigmas: f64,
}

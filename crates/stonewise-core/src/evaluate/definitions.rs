//! What the figures of an evaluation mean, in words that travel with them.

use std::collections::BTreeMap;

const WORDS: [(&str, &str); 23] = [
    ("error", "estimate minus truth; all lengths in metres"),
    (
        "truth",
        "true displacement (second epoch minus first) at the stone's epoch-1 centroid, or at the core point; for a bulge the field at that place, not its mean over the stone",
    ),
    (
        "along",
        "signed error along the dam: horizontal in the face, to the right of a viewer who faces it",
    ),
    ("up", "signed error up the face, along the batter"),
    (
        "in_plane_per_axis",
        "signed along and up errors pooled; its RMSE is sqrt((along^2 + up^2) / 2), the in-plane RMSE per axis",
    ),
    ("in_plane_2d", "norm of the (along, up) error"),
    (
        "out_of_plane",
        "signed error along the outward normal of the face",
    ),
    ("norm_3d", "norm of the whole error"),
    ("count", "number of errors the figures rest on"),
    ("rmse_m", "root of the mean squared error"),
    ("mean_m", "mean error: the bias of a signed component"),
    ("median_m", "median error, with its sign"),
    ("nmad_m", "1.4826 times the median of |error - median error|"),
    (
        "p95_m",
        "95th percentile of the absolute errors, interpolated linearly between order statistics",
    ),
    (
        "outlier_rate",
        "share of absolute errors beyond outlier_m; at the top of a score that of the 3D error",
    ),
    (
        "zero_predictor_rmse_m",
        "RMSE of an estimator that always answers zero: the figure to beat",
    ),
    (
        "coverage_95",
        "share of true components inside the estimate +- 1.96 standard deviations; for M3C2 out of plane inside +- its detection limit; 0.95 is right",
    ),
    (
        "calibration",
        "the claims against the truth; null where the error of the epochs' registration is not known; calibration_without_datum: after the least-squares rigid motion of the stones that are not loose, weighted by their inverse covariances, is taken off estimates and truths, with covariances that leave the registration error out",
    ),
    (
        "chi_square",
        "error' covariance^-1 error, chi-square with 3 degrees of freedom when the covariance is right: mean 3, median 2.37, 95 % below 7.81",
    ),
    (
        "neighbours",
        "displacement of a stone less that of a neighbour, compared with the same difference of the truth, with the covariance of the difference (neighbours.parquet); shows how accurate openings of joints are",
    ),
    (
        "rotations",
        "error of a stone's rotation: rotation vector from the true to the estimated orientation, milliradians, about the axes along the dam, up the face and out of it; angle: its length; coverage_95.along is the coverage of the rotation about the axis along the dam, and so on",
    ),
    (
        "significance",
        "alarms (significant at 95 %) among places that truly moved at most still_m (false alarms) and more (hits); detectable: truly moved more than the place's own detection limit",
    ),
    (
        "m3c2",
        "displacement vector of M3C2 is distance times normal; it claims nothing in the plane",
    ),
];

/// The definitions, by the key they explain.
pub fn definitions() -> BTreeMap<String, String> {
    WORDS
        .iter()
        .map(|(key, words)| ((*key).to_owned(), (*words).to_owned()))
        .collect()
}

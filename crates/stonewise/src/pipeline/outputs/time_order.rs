//! Epochs in the order of time, and what each brings into the error of a pair.

use crate::project::Project;
use crate::results::StoneRow;
use crate::results::calendar::day_of;
use crate::results::records::EstimatorRecord;
use stonewise_core::epoch::EpochId;

/// The day of an epoch, where it is dated.
pub fn day(project: &Project, epoch: EpochId) -> Option<f64> {
    project.epochs[epoch].date.as_deref().and_then(day_of)
}

/// All epochs in the order of time: by their dates if all have one, else as they are numbered.
pub fn in_time_order(project: &Project) -> Vec<EpochId> {
    let mut ids: Vec<EpochId> = project.epochs.ids().collect();
    let days: Option<Vec<f64>> = ids.iter().map(|id| day(project, *id)).collect();
    if let Some(days) = days {
        ids.sort_by(|a, b| days[a.index()].total_cmp(&days[b.index()]));
    }
    ids
}

/// The part of a motion's variance that the reference brings in: in proportion to the variances of the means of the
/// points of both epochs. A half where the estimator gives no noise.
pub fn reference_share(estimator: &EstimatorRecord, row: &StoneRow) -> f64 {
    let EstimatorRecord::Adjustment(record) = estimator else {
        return 0.5;
    };
    let ([Some(first), Some(later)], Some(points)) = (record.noise_m, row.points_2) else {
        return 0.5;
    };
    let of = |noise_m: f64, points: u32| noise_m * noise_m / f64::from(points.max(1));
    let (first, later) = (of(first, row.points_1), of(later, points));
    match first + later > 0.0 {
        true => first / (first + later),
        false => 0.5,
    }
}

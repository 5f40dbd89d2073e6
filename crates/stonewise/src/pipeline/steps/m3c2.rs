//! M3C2 between two epochs of a project.

use crate::error::Result;
use crate::pipeline::cost::Cost;
use crate::pipeline::graph::{About, Need, Phase, Run, Step};
use crate::pipeline::steps::ingest::INGEST;
use crate::pipeline::steps::segment::SEGMENT;
use crate::pipeline::until::Until;
use crate::results::records::Datum;
use crate::storage::step::{Key, StepDir};
use nalgebra::{Matrix3, Point3, Vector3};
use std::path::Path;
use std::sync::Arc;
use stonewise_core::change::{ChangeField, ChangePoint, M3c2Params, OutwardReference, m3c2_survey};
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::View;
use stonewise_core::registration::observers::EpochErrors;
use stonewise_io::table::{Table, read_parquet, write_parquet};

/// The comparison, one row of about 100 bytes a core point; as JSON it took 295, 1.3 GB for the 4.3 million
/// of a dam.
const FIELD: &str = "field.parquet";

/// Compares the clouds of a later epoch with those of the reference, along normals.
pub static M3C2: Step = Step {
    name: "m3c2",
    phase: Some(Phase::Compare),
    about: About::Later,
    needs: &[
        Need::reference(&INGEST),
        Need::same(&INGEST),
        Need::reference(&SEGMENT),
    ],
    wanted: |until| until >= Until::Compared,
    // Tiles with their surroundings, and the core points.
    cost: Some(|sizes, _| Cost::of(4, (512 << 20) + sizes.cloud_bytes(EpochId::REFERENCE))),
    make: |run, epoch| run.compared(epoch).map(drop),
    ..Step::PLAIN
};

impl Run<'_> {
    /// The comparison of the clouds of a later epoch, on disk.
    pub fn compared(&self, later: EpochId) -> Result<Arc<StepDir>> {
        self.once(&M3C2, later, || {
            let photos = self.segmented(EpochId::REFERENCE)?;
            let centres: Vec<Point3<f64>> = photos.views.iter().map(View::centre).collect();
            m3c2(self, later, &OutwardReference::Towards(&centres))
        })
    }
}

/// Compares two epochs along the normals of the reference, in whatever direction is outwards.
pub fn m3c2(run: &Run, later: EpochId, outward: &OutwardReference) -> Result<StepDir> {
    let (clouds, params) = (run.clouds(later)?, &run.context.project.settings.m3c2);
    let motions = clouds
        .each_ref()
        .map(|e| e.tiles.motion.as_ref().map(|m| &m.field))
        .into_array();
    let keys = clouds.each_ref().map(|e| e.step.key().as_str()).into_array();
    let key = Key::new("m3c2", &(params, motions), &keys);
    run.context.step(&format!("m3c2-{later}"), key, |step, _| {
        let tiles = clouds.each_ref().map(|e| &e.tiles);
        let field = m3c2_survey(tiles.first, tiles.later, outward, params, run.context.progress)?;
        Ok(write_parquet(&step.file(FIELD), &field_table(&field)?)?)
    })
}

/// The comparison that the step left.
pub fn change_field(step: &StepDir) -> Result<ChangeField> {
    read_field(&step.file(FIELD))
}

/// The comparison with detection limits that hold the registration error of the epochs, point by point.
///
/// Distances stay those of the clouds as they lie, so what the datum shows to be an error counts beside what
/// stays uncertain of it: reg^2 = n' C n + (n' e)^2, with the error `e` and its covariance `C` at the core
/// point, as registration.json has them. Nothing changes where the project states an error for M3C2. Where
/// the datum is unknown, only the few points of a cylinder are accounted for.
pub fn with_datum(
    change: ChangeField,
    params: &M3c2Params,
    datum: &Datum,
    errors: Option<&EpochErrors>,
) -> ChangeField {
    if params.registration_error_m > 0.0 {
        return change;
    }
    let rigid = errors.filter(|_| datum.is_estimated()).map(|e| &e.rigid);
    change.with_registration_errors(|point| {
        let covariance = datum
            .covariance_at(&point.position)
            .unwrap_or_else(Matrix3::zeros);
        let error = datum.taken_off_at(&point.position);
        let error = error
            .or_else(|| Some(rigid?.at(&point.position)))
            .unwrap_or_default();
        let variance = point.normal.dot(&(covariance * point.normal)).max(0.0);
        variance.sqrt().hypot(point.normal.dot(&error))
    })
}

/// The comparison as a table, with PDAL's names of dimensions.
pub fn field_table(field: &ChangeField) -> Result<Table> {
    let points = &field.points;
    let real = |of: fn(&ChangePoint) -> f64| points.iter().map(of).collect::<Vec<f64>>();
    let known = |of: fn(&ChangePoint) -> Option<f64>| points.iter().map(of).collect::<Vec<_>>();
    let count = |of: fn(&ChangePoint) -> u32| points.iter().map(of).collect::<Vec<u32>>();
    let mut table = Table::new();
    table.push("x", "m", "core point, world x", real(|p| p.position.x))?;
    table.push("y", "m", "core point, world y", real(|p| p.position.y))?;
    table.push("z", "m", "core point, world z", real(|p| p.position.z))?;
    let outward = "unit normal out of the wall, world";
    table.push("NormalX", "", &format!("{outward} x"), real(|p| p.normal.x))?;
    table.push("NormalY", "", &format!("{outward} y"), real(|p| p.normal.y))?;
    table.push("NormalZ", "", &format!("{outward} z"), real(|p| p.normal.z))?;
    let meaning = "distance along the normal, positive out of the wall";
    table.push("m3c2_distance", "m", meaning, known(|p| p.distance_m))?;
    let meaning = "95 % detection limit of the distance";
    table.push("m3c2_uncertainty", "m", meaning, known(|p| p.detection_limit_m))?;
    let meaning = "spread of the first epoch's points along the normal";
    table.push("m3c2_std_dev1", "m", meaning, known(|p| p.spread_m[0]))?;
    let meaning = "spread of the later epoch's points along the normal";
    table.push("m3c2_std_dev2", "m", meaning, known(|p| p.spread_m[1]))?;
    let meaning = "1 where the distance exceeds its detection limit, else 0";
    table.push(
        "m3c2_significant",
        "",
        meaning,
        count(|p| u32::from(p.is_significant())),
    )?;
    let meaning = "points of the first epoch in the cylinder";
    table.push("m3c2_count1", "", meaning, count(|p| p.counts[0]))?;
    let meaning = "points of the later epoch in the cylinder";
    table.push("m3c2_count2", "", meaning, count(|p| p.counts[1]))?;
    Ok(table)
}

fn read_field(path: &Path) -> Result<ChangeField> {
    let table = read_parquet(path)?;
    let [x, y, z] = [
        table.required::<f64>("x")?,
        table.required("y")?,
        table.required("z")?,
    ];
    let [nx, ny, nz] = [
        table.required::<f64>("NormalX")?,
        table.required("NormalY")?,
        table.required("NormalZ")?,
    ];
    let distance_m = table.optional::<f64>("m3c2_distance")?;
    let detection_limit_m = table.optional::<f64>("m3c2_uncertainty")?;
    let spread_m = [
        table.optional::<f64>("m3c2_std_dev1")?,
        table.optional::<f64>("m3c2_std_dev2")?,
    ];

    let counts = [
        table.required::<u32>("m3c2_count1")?,
        table.required::<u32>("m3c2_count2")?,
    ];
    let points = (0..table.rows()).map(|i| ChangePoint {
        position: Point3::new(x[i], y[i], z[i]),
        normal: Vector3::new(nx[i], ny[i], nz[i]),
        distance_m: distance_m[i],
        detection_limit_m: detection_limit_m[i],
        spread_m: [spread_m[0][i], spread_m[1][i]],
        counts: [counts[0][i], counts[1][i]],
    });

    Ok(ChangeField {
        points: points.collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::records::DatumState;
    use nalgebra::Matrix6;

    fn flat() -> ChangeField {
        let point = |x: f64| ChangePoint {
            position: Point3::new(x, 0.0, 0.0),
            normal: Vector3::y(),
            distance_m: Some(0.0),
            detection_limit_m: Some(0.0),
            spread_m: [Some(0.0); 2],
            counts: [500; 2],
        };
        ChangeField {
            points: vec![point(0.0), point(10.0)],
        }
    }

    #[test]
    fn a_turned_epoch_is_less_certain_far_from_the_middle() {
        // 2 mm along the normal, and 0.1 mrad about z: 1 mm at an arm of 10 m.
        let covariance = Matrix6::from_diagonal(&[0.0, 4e-6, 0.0, 0.0, 0.0, 1e-8].into());
        let datum = Datum::known(DatumState::Stated, &Point3::origin(), &covariance, String::new());
        let limits = |params: &M3c2Params, datum: &Datum| {
            let field = with_datum(flat(), params, datum, None);
            [0, 1].map(|k| field.points[k].detection_limit_m.unwrap())
        };
        let found = limits(&M3c2Params::default(), &datum);
        assert!((found[0] - 1.96 * 0.002).abs() < 1e-6, "{found:?}");
        assert!((found[1] - 1.96 * 5e-6_f64.sqrt()).abs() < 1e-6, "{found:?}");
        let stated = M3c2Params {
            registration_error_m: 0.01,
            ..M3c2Params::default()
        };
        assert_eq!(limits(&stated, &datum), [0.0; 2]);
        let unknown = Datum::unknown(&Point3::origin(), String::new());
        assert_eq!(limits(&M3c2Params::default(), &unknown), [0.0; 2]);
    }

    #[test]
    fn a_field_reads_back_to_the_bit() {
        let point = |i: u32| ChangePoint {
            position: Point3::new(4.5e6 + 1e-9 * f64::from(i), -0.1, 1.0 / 3.0),
            normal: Vector3::new(0.6, -0.0, 0.8),
            distance_m: i.is_multiple_of(2).then_some(1e-3 / f64::from(i + 1)),
            detection_limit_m: i.is_multiple_of(3).then_some(f64::MIN_POSITIVE),
            spread_m: [Some(f64::from(i).sqrt()), (i > 5).then_some(0.0)],
            counts: [i, u32::MAX - i],
        };
        let folder = tempfile::tempdir().unwrap();
        for count in [0, 1, 40] {
            let field = ChangeField {
                points: (0..count).map(point).collect(),
            };
            let path = folder.path().join(FIELD);
            write_parquet(&path, &field_table(&field).unwrap()).unwrap();
            assert_eq!(read_field(&path).unwrap(), field);
        }
    }
}

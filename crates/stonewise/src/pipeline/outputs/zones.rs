//! Zones of deformation of all later epochs.

use crate::error::Result;
use crate::pipeline::graph::{Need, Run, Step};
use crate::pipeline::steps::measure::MEASURE;
use crate::pipeline::until::Until;
use crate::results::ZonePlace;
use crate::results::names::ZONES as FILE;
use stonewise_core::registration::DeformationZone;
use stonewise_io::table::{Table, write_parquet};

/// Writes `zones.parquet`: one row for each zone of each later epoch.
pub static ZONES: Step = Step {
    name: "zones",
    needs: &[Need::all(&MEASURE)],
    wanted: |until| until >= Until::Registered,
    make: |run, _| write_zones(run),
    ..Step::PLAIN
};

fn write_zones(run: &Run) -> Result<()> {
    let context = run.context;
    let mut rows: Vec<(String, DeformationZone, ZonePlace)> = Vec::new();
    for later in context.project.epochs.later_ids() {
        let (registered, measured) = (run.registered(later)?, run.measured(later)?);
        for zone in registered.deformation.iter().flat_map(|d| &d.zones) {
            let place = ZonePlace::of(zone, &measured.rows);
            rows.push((context.project.epochs[later].name.clone(), zone.clone(), place));
        }
    }

    let words = |of: fn(&DeformationZone) -> &'static str| -> Vec<String> {
        rows.iter().map(|row| of(&row.1).to_owned()).collect()
    };
    let mut table = Table::new();
    let epochs: Vec<String> = rows.iter().map(|row| row.0.clone()).collect();
    table.push("epoch", "", "name of the later epoch", epochs)?;
    let ids: Vec<u32> = rows.iter().map(|row| row.1.number).collect();
    table.push(
        "zone_id",
        "",
        "zone of deformation, as in the stone table of the epoch",
        ids,
    )?;
    let mut metres = |name: &str, unit: &str, meaning: &str, of: fn(&DeformationZone, &ZonePlace) -> f64| {
        let values: Vec<f64> = rows.iter().map(|row| of(&row.1, &row.2)).collect();
        table.push(name, unit, meaning, values)
    };
    metres("area_m2", "m2", "area of the faces of its stones", |_, p| {
        p.area_m2
    })?;
    metres("along_m", "m", "middle along the unrolled wall", |_, p| {
        p.middle_m[0]
    })?;
    metres("up_m", "m", "middle up the unrolled wall", |_, p| p.middle_m[1])?;
    metres("length_m", "m", "length", |z, _| z.length_m)?;
    metres("width_m", "m", "width", |z, _| z.width_m)?;
    metres("largest_m", "m", "largest deformation of a stone", |z, _| {
        z.largest_m
    })?;
    metres("lower_m", "m", "lower end of its 95 % interval", |z, _| {
        z.interval_m[0]
    })?;
    metres("upper_m", "m", "upper end of its 95 % interval", |z, _| {
        z.interval_m[1]
    })?;
    let diameters: Vec<Option<f64>> = rows.iter().map(|row| row.1.diameter_m).collect();
    table.push("diameter_m", "m", "diameter of a round zone", diameters)?;
    table.push(
        "kind",
        "",
        "what it resembles: bulge, lean, settlement, step or other",
        words(|z| z.kind.word()),
    )?;
    table.push(
        "against",
        "",
        "what its motion counts from: rest_of_wall or rest_of_part, each without what deformed",
        words(|z| z.against.word()),
    )?;

    Ok(write_parquet(&context.out.join(FILE), &table)?)
}

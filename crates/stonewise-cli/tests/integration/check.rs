//! `check`, and what a run makes of surveys that cannot be right.

use crate::support::{SHARP, copy_of, outcome, run, simulated, stonewise, survey, tiny_survey};
use nalgebra::Point3;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_core::raster::{LabelImage, Raster};
use stonewise_io::cloud::{CloudError, read_cloud, write_points_laz};
use stonewise_io::image_io::{read_rgb, write_jpeg};
use stonewise_io::masks::write_label_png;

/// Runs `check`; exit code, table, log.
fn check(survey: &Path) -> (i32, String, String) {
    let mut command = stonewise();
    command
        .arg("check")
        .arg(survey.join("stonewise.toml"))
        .arg("--out")
        .arg(survey.join("out"))
        .arg("--page")
        .arg(survey.join("stonewise.check.html"));
    let output = command.output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (table, log) = (text(&output.stdout), text(&output.stderr));
    assert!(!log.contains("panicked"), "{log}");
    (output.status.code().unwrap(), table, log)
}

fn points(cloud: &Path) -> Vec<Point3<f64>> {
    let mut points = Vec::new();
    read_cloud(cloud, 100_000, |chunk| {
        points.extend_from_slice(&chunk.positions);
        Ok::<(), CloudError>(())
    })
    .unwrap();
    points
}

/// Replaces a cloud by the same points somewhere else.
fn map_cloud(cloud: &Path, to: impl Fn(&Point3<f64>) -> Point3<f64>) {
    let moved: Vec<Point3<f64>> = points(cloud).iter().map(to).collect();
    replace(cloud, None, &moved);
}

/// Writes a cloud again with the code of a coordinate system in its header.
fn code_system(dir: &Path, cloud: &str, code: &str) {
    let cloud = dir.join(cloud);
    replace(&cloud, Some(code), &points(&cloud));
}

fn replace(cloud: &Path, crs: Option<&str>, points: &[Point3<f64>]) {
    fs::remove_file(cloud).unwrap();
    write_points_laz(cloud, crs, points, &[]).unwrap();
}

/// Writes a cloud again with a coordinate system in its header.
fn name_system(cloud: &Path, epsg: u32) {
    let points = points(cloud);
    let wkt = format!(
        "PROJCS[\"system {epsg}\",GEOGCS[\"ETRS89\",DATUM[\"x\",SPHEROID[\"GRS 1980\",6378137,298.257222101]],PRIMEM[\"Greenwich\",0],\
         UNIT[\"degree\",0.0174532925199433]],PROJECTION[\"Transverse_Mercator\"],UNIT[\"metre\",1],AUTHORITY[\"EPSG\",\"{epsg}\"]]"
    );
    replace(cloud, Some(&wkt), &points);
}

/// Photos of the second epoch.
fn photos(survey: &Path) -> Vec<PathBuf> {
    let mut photos: Vec<_> = fs::read_dir(survey.join("epoch2/images"))
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
    photos.sort();
    photos
}

fn first_photo(survey: &Path) -> PathBuf {
    photos(survey).swap_remove(0)
}

/// What is wrong; how the survey is spoilt; a word of the table; whether a run stops.
type Case = (&'static str, fn(&Path), &'static str, bool);

const CLOUD_2: &str = "epoch2/cloud_tls.laz";

const CASES: [Case; 17] = [
    (
        "feet",
        |dir| map_cloud(&dir.join(CLOUD_2), |p| p / 0.3048),
        "is in feet: export its coordinates in metres",
        true,
    ),
    (
        "two coordinate systems",
        |dir| {
            name_system(&dir.join("epoch1/cloud_tls.laz"), 25832);
            name_system(&dir.join(CLOUD_2), 25833);
        },
        "EPSG:25832 (epoch 1), EPSG:25833 (epoch 2): transform them to one",
        true,
    ),
    (
        "one epoch in feet, by its number alone, with coordinates in metres",
        |dir| code_system(dir, CLOUD_2, "EPSG:2263"),
        "is in feet: export its coordinates in metres",
        true,
    ),
    (
        "a system in degrees with heights, by its number alone",
        |dir| code_system(dir, CLOUD_2, "EPSG:9518"),
        "coordinate system is in degrees",
        true,
    ),
    (
        "a cloud elsewhere",
        |dir| {
            map_cloud(&dir.join(CLOUD_2), |p| {
                p + nalgebra::Vector3::new(100.0, 0.0, 0.0)
            })
        },
        "do not overlap",
        true,
    ),
    (
        "cameras elsewhere",
        |dir| {
            for cloud in ["epoch1/cloud_tls.laz", CLOUD_2] {
                map_cloud(&dir.join(cloud), |p| p + nalgebra::Vector3::new(0.0, 100.0, 0.0));
            }
        },
        "no photo sees the cloud",
        true,
    ),
    (
        "the same cloud twice",
        |dir| {
            let path = dir.join("stonewise.toml");
            let text = fs::read_to_string(&path).unwrap();
            fs::write(path, text.replace(CLOUD_2, "epoch1/cloud_tls.laz")).unwrap();
        },
        "and so does epoch",
        false,
    ),
    (
        "a copy of the first epoch's cloud",
        |dir| {
            fs::copy(dir.join("epoch1/cloud_tls.laz"), dir.join(CLOUD_2)).unwrap();
        },
        "100 % of the points are those of epoch",
        false,
    ),
    (
        "a cloud that is there twice",
        |dir| {
            fs::copy(dir.join(CLOUD_2), dir.join("epoch2/again.laz")).unwrap();
            let path = dir.join("stonewise.toml");
            let text = fs::read_to_string(&path).unwrap();
            let both = format!("{CLOUD_2}\", \"epoch2/again.laz");
            fs::write(path, text.replace(CLOUD_2, &both)).unwrap();
        },
        "100 % of the points are there twice",
        false,
    ),
    (
        "coordinates in steps of 5 cm",
        |dir| map_cloud(&dir.join(CLOUD_2), |p| p.map(|c| (c * 20.0).round() / 20.0)),
        "the coordinates are in steps of 50.0 mm",
        false,
    ),
    (
        "a photo that is missing",
        |dir| fs::remove_file(first_photo(dir)).unwrap(),
        "IMG_2001 (1 of 2 posed photos)",
        false,
    ),
    (
        "exchanged photos",
        |dir| {
            let [one, other] = photos(dir).try_into().unwrap();
            let (first, second) = (fs::read(&one).unwrap(), fs::read(&other).unwrap());
            fs::write(one, second).unwrap();
            fs::write(other, first).unwrap();
        },
        "no two photos show the same",
        false,
    ),
    (
        "a photo of one colour",
        |dir| {
            let photo = first_photo(dir);
            fs::remove_file(&photo).unwrap();
            write_jpeg(&photo, &Raster::filled(600, 450, [118; 3]), 90).unwrap();
        },
        "of one colour: IMG_2001",
        false,
    ),
    (
        "an empty photo",
        |dir| fs::write(first_photo(dir), "").unwrap(),
        "cannot be read or are cut off",
        false,
    ),
    (
        "a photo that is none",
        |dir| fs::write(first_photo(dir), "this is no photo").unwrap(),
        "cannot be read or are cut off",
        false,
    ),
    (
        "a photo that is cut off",
        |dir| {
            let photo = first_photo(dir);
            let bytes = fs::read(&photo).unwrap();
            fs::write(photo, &bytes[..bytes.len() / 2]).unwrap();
        },
        "cannot be read or are cut off",
        false,
    ),
    (
        "a photo of another size",
        |dir| {
            let photo = first_photo(dir);
            let whole = read_rgb(&photo).unwrap();
            let half = Raster::from_vec(
                whole.width(),
                whole.height() / 2,
                whole.data()[..(whole.width() * (whole.height() / 2)) as usize].to_vec(),
            );
            fs::remove_file(&photo).unwrap();
            write_jpeg(&photo, &half.unwrap(), 90).unwrap();
        },
        "camera 600x450 px",
        false,
    ),
];

#[test]
fn a_sound_survey_passes() {
    let (_dir, survey) = simulated(SHARP);
    let (code, table, log) = check(&survey);
    assert_eq!(code, 0, "{table}{log}");
    assert_eq!(table.matches("edges fit best 0 px").count(), 2, "{table}");
    for line in [
        "point spacing",
        "overlap",
        "photos",
        "cameras against cloud",
        "disk",
        "memory",
        "time",
    ] {
        assert!(table.contains(line), "{line}: {table}");
    }
    let page = fs::read_to_string(survey.join("stonewise.check.html")).unwrap();
    assert_eq!(
        page.matches("data:image/jpeg").count(),
        2,
        "a picture for each epoch"
    );
    // The page is replaced, but nothing else of that name.
    assert_eq!(check(&survey).0, 0);
    fs::write(survey.join("stonewise.check.html"), "mine").unwrap();
    let (code, _, log) = check(&survey);
    assert!(code == 1 && log.contains("no page of this command"), "{log}");
}

#[test]
fn a_page_that_is_not_asked_for_leaves_the_survey_as_it_is() {
    let (survey, temporary) = (copy_of(tiny_survey()), tempfile::tempdir().unwrap());
    let names = |folder: &Path| -> BTreeSet<_> {
        let entries = fs::read_dir(folder).unwrap();
        entries.map(|entry| entry.unwrap().file_name()).collect()
    };
    let before = names(survey.path());
    let mut command = stonewise();
    command.arg("check").arg(survey.path().join("stonewise.toml"));
    command
        .env("TMPDIR", temporary.path())
        .env("TMP", temporary.path());
    let output = command.output().unwrap();
    assert_eq!(names(survey.path()), before);
    let log = String::from_utf8_lossy(&output.stderr);
    let page = log
        .lines()
        .find_map(|line| line.strip_prefix("pictures: "))
        .unwrap();
    assert!(Path::new(page).starts_with(temporary.path()), "{page}");
    assert!(
        fs::read_to_string(page)
            .unwrap()
            .contains("a look at the survey</title>")
    );
}

#[test]
fn photos_of_cameras_that_epochs_share_are_not_missing() {
    let survey = copy_of(tiny_survey());
    let halves = survey.path().join("halves");
    let mut split = stonewise();
    split
        .args(["test", "split"])
        .arg(survey.path().join("stonewise.toml"));
    let (code, log) = outcome(split.arg("--seed").arg("1").arg("--out").arg(&halves));
    assert_eq!(code, 0, "{log}");
    let (code, table, log) = check(&halves);
    assert_eq!(code, 0, "{table}{log}");
    assert!(
        table.contains("1 of the 2 posed photos are there, the others in another epoch"),
        "{table}"
    );
}

#[test]
fn photos_that_are_not_there_are_not_said_to_see_nothing() {
    let survey = copy_of(tiny_survey());
    for (number, photo) in photos(survey.path()).into_iter().enumerate() {
        fs::rename(
            &photo,
            photo.with_file_name(format!("of_another_day_{number}.jpg")),
        )
        .unwrap();
    }
    let (code, table, log) = check(survey.path());
    assert_eq!(code, 3, "{table}{log}");
    assert!(table.contains("none of the photos"), "{table}");
    assert!(!table.contains("no photo sees"), "{table}");
}

#[test]
fn broken_surveys_are_named_and_a_run_stops_where_they_cannot_be_right() {
    for (what, spoil, word, stops) in CASES {
        let survey = copy_of(tiny_survey());
        spoil(survey.path());
        let (code, table, log) = check(survey.path());
        println!("--- {what}\n{table}");
        assert_eq!(code, 3, "{what}: {table}{log}");
        assert!(table.contains(word), "{what}: {table}{log}");
        if stops {
            let out = survey.path().join("out");
            let (code, log) = run(survey.path(), &out, &[]);
            assert!(
                code == 1 && log.contains("cannot be right") && log.contains(word),
                "{what}: {code} {log}"
            );
            assert!(!out.join("stones.csv").exists());
        }
    }
}

#[test]
fn everything_is_looked_at_where_inputs_cannot_be_read() {
    let survey = copy_of(tiny_survey());
    let (cloud, dir) = (fs::read(survey.path().join(CLOUD_2)).unwrap(), survey.path());
    fs::write(dir.join("epoch1/cloud_tls.laz"), "").unwrap();
    fs::write(dir.join(CLOUD_2), &cloud[..cloud.len() / 2]).unwrap();
    fs::remove_file(first_photo(dir)).unwrap();
    let (code, table, log) = check(dir);
    assert_eq!(code, 1, "{table}{log}");
    let lines: Vec<&str> = table.lines().filter(|l| l.contains(" ERROR ")).collect();
    assert_eq!(lines.len(), 2, "{table}");
    for (line, epoch) in lines.iter().zip(["1", "2"]) {
        let place = format!("epoch{epoch}/cloud_tls.laz");
        assert!(
            line.starts_with(&format!("epoch {epoch}")) && line.contains(&place),
            "{table}"
        );
    }
    assert!(
        table.contains("all 2 posed photos") && table.contains("DOUBT  missing in"),
        "{table}"
    );
    let page = fs::read_to_string(dir.join("stonewise.check.html")).unwrap();
    assert!(page.contains("An input cannot be read"));
    // One that can be read is looked at in full.
    fs::write(dir.join(CLOUD_2), &cloud).unwrap();
    let (code, table, log) = check(dir);
    assert_eq!(code, 1, "{table}{log}");
    assert!(table.contains("epoch 2  point spacing"), "{table}");
}

#[test]
fn masks_that_a_run_cannot_use_are_found() {
    let survey = copy_of(tiny_survey());
    let dir = survey.path();
    let json = dir.join("masks/epoch2.json");
    fs::write(&json, "").unwrap();
    let (code, table, log) = check(dir);
    assert!(
        code == 1 && table.contains("not a COCO instances file"),
        "{table}{log}"
    );
    // Label images for both photos, one of them cut off, then one of them gone.
    fs::remove_file(json).unwrap();
    let masks = dir.join("masks/epoch2");
    let project = dir.join("stonewise.toml");
    let text = fs::read_to_string(&project).unwrap();
    fs::write(project, text.replace("masks/epoch2.json", "masks/epoch2")).unwrap();
    fs::create_dir(&masks).unwrap();
    let of = |photo: &Path| masks.join(photo.file_name().unwrap()).with_extension("png");
    let write_all = |labels: &LabelImage| {
        for photo in photos(dir) {
            write_label_png(&of(&photo), labels).unwrap();
        }
    };
    write_all(&LabelImage::filled(600, 450, 7));
    let (code, table, log) = check(dir);
    assert!(
        code == 3 && table.contains("DOUBT  one single mask in each photo"),
        "{table}{log}"
    );
    let halves = (0..600 * 450).map(|i| 7 + u32::from(i % 600 >= 300)).collect();
    write_all(&LabelImage::from_vec(600, 450, halves).unwrap());
    let (code, table, log) = check(dir);
    assert!(
        code == 0 && table.contains("there for every photo (2): "),
        "{table}{log}"
    );
    let first = of(&first_photo(dir));
    let bytes = fs::read(&first).unwrap();
    fs::write(&first, &bytes[..bytes.len() / 2]).unwrap();
    let (code, table, log) = check(dir);
    assert!(
        code == 3 && table.contains("DOUBT  cannot be used for"),
        "{table}{log}"
    );
    fs::remove_file(&first).unwrap();
    let (code, table, log) = check(dir);
    assert!(code == 3 && table.contains("DOUBT  none in"), "{table}{log}");
}

#[test]
fn a_doubtful_survey_runs_with_exit_code_3_and_says_so_first() {
    let survey = copy_of(survey());
    fs::write(first_photo(survey.path()), "").unwrap();
    let out = survey.path().join("out");
    let (code, log) = run(survey.path(), &out, &["--quiet"]);
    assert_eq!(code, 3, "{log}");
    let report = fs::read_to_string(out.join("report.html")).unwrap();
    let (_, after_title) = report.split_once("</h1>").unwrap();
    assert!(
        after_title.starts_with("<div class=\"verdict"),
        "the verdict is not the first line"
    );
    let verdict = after_title.split_once("</div>").unwrap().0;
    assert!(verdict.contains("must not be relied on"), "{verdict}");
}

#[test]
fn clouds_far_off_their_photos_end_in_exit_code_3_even_by_force() {
    let survey = copy_of(survey());
    map_cloud(&survey.path().join(CLOUD_2), |p| {
        p + nalgebra::Vector3::new(0.0, 0.12, 0.0)
    });
    let out = survey.path().join("out");
    let (code, log) = run(survey.path(), &out, &["--force"]);
    assert_eq!(code, 3, "{log}");
    assert!(
        log.contains("DOUBT: ") && log.contains("off the stones that the photos show"),
        "{log}"
    );
}

#[test]
fn wrong_projects_are_wrong_usage() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("stonewise.toml"), "[project]\n").unwrap();
    let mut command = stonewise();
    let (code, log) = outcome(command.arg("check").arg(dir.path().join("stonewise.toml")));
    assert_eq!(code, 2, "{log}");
}

/// A command with two threads and a limit on its address space, KiB.
#[cfg(target_os = "linux")]
fn limited(kib: u32, command: &str) -> assert_cmd::Command {
    let mut shell = assert_cmd::Command::new("sh");
    shell
        .arg("-c")
        .arg(format!("ulimit -v {kib}; exec \"$0\" \"$@\""))
        .arg(crate::support::program())
        .args([command, "--threads", "2"]);
    shell
}

/// A stack of 2^62 bytes is more than any system gives a thread, so that it starts none.
#[cfg(target_os = "linux")]
#[test]
fn threads_that_do_not_start_are_said_before_the_work() {
    let out = tempfile::tempdir().unwrap();
    let mut run = stonewise();
    run.env("RUST_MIN_STACK", (1u64 << 62).to_string())
        .arg("run")
        .arg(tiny_survey().join("stonewise.toml"))
        .arg("--out")
        .arg(out.path().join("results"));
    let (code, log) = outcome(&mut run);
    assert_eq!(code, 1, "{log}");
    assert!(
        log.contains("error: the threads cannot be started (fewer: --threads)"),
        "{log}"
    );
    assert!(!out.path().join("results").exists(), "something was written");
}

/// A `df` that finds 1 MB free stands before that of the system.
#[cfg(unix)]
#[test]
fn a_disk_that_is_too_small_is_said_and_stops_nothing() {
    use std::os::unix::fs::PermissionsExt;
    let home = tempfile::tempdir().unwrap();
    let df = home.path().join("df");
    let answer = "Filesystem 1024-blocks Used Available Capacity Mounted on\ndisk 2000 1000 1000 50% /";
    fs::write(&df, format!("#!/bin/sh\ncat <<END\n{answer}\nEND\n")).unwrap();
    fs::set_permissions(&df, fs::Permissions::from_mode(0o755)).unwrap();
    let path = std::env::var("PATH").unwrap();
    for (command, code) in [("check", 3), ("run", 0)] {
        let mut program = stonewise();
        program
            .env("PATH", format!("{}:{path}", home.path().display()))
            .arg(command)
            .arg(tiny_survey().join("stonewise.toml"))
            .arg("--out")
            .arg(home.path().join("results"));
        let output = program.output().unwrap();
        let text = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
        assert_eq!(output.status.code(), Some(code), "{text}");
        assert!(
            text.contains("0.0 GB free: make room, or give --out on another disk"),
            "{text}"
        );
    }
}

/// 530,000 KiB leave a little more than 200 MB after program and threads, half of what `check` counts on.
#[cfg(target_os = "linux")]
#[test]
fn too_little_memory_is_said_by_check() {
    let mut check = limited(530_000, "check");
    let output = check.arg(tiny_survey().join("stonewise.toml")).output().unwrap();
    let text = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
    assert_eq!(output.status.code(), Some(3), "{text}");
    assert!(
        text.contains("end other programs, or run on a part of the survey"),
        "{text}"
    );
}

#[cfg(target_os = "linux")]
#[test]
fn the_demo_says_that_no_limit_leaves_it_enough() {
    let out = tempfile::tempdir().unwrap();
    // From where the program itself can just be loaded to where everything but the detector would work.
    for kib in [200_000, 300_000, 500_000, 700_000] {
        let mut demo = limited(kib, "demo");
        let (code, log) = outcome(demo.arg("--out").arg(out.path().join("demo")));
        assert_eq!(code, 1, "{kib}: {log}");
        assert!(
            log.contains("of address space, and only") && log.contains("(`ulimit -v`)"),
            "{kib}: {log}"
        );
        assert!(!out.path().join("demo").exists(), "{kib}: something was written");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn too_little_address_space_is_said_before_the_work() {
    let out = tempfile::tempdir().unwrap();
    // 200 MB for a small survey and 64 MB for each thread are more than 400,000 KiB.
    let mut run = limited(400_000, "run");
    run.arg(tiny_survey().join("stonewise.toml"))
        .arg("--out")
        .arg(out.path().join("results"));
    let (code, log) = outcome(&mut run);
    assert_eq!(code, 1, "{log}");
    assert!(
        log.contains("a run of this survey takes about 0.5 GB of address space"),
        "{log}"
    );
    assert!(log.contains("only 0.4 GB are allowed (`ulimit -v`)"), "{log}");
    let mut segment = limited(400_000, "segment");
    segment
        .arg(tiny_survey().join("epoch1/images"))
        .arg("--out")
        .arg(out.path().join("stones"));
    let (code, log) = outcome(&mut segment);
    assert_eq!(code, 1, "{log}");
    assert!(
        log.contains("the search for stones in photos takes about 1.1 GB"),
        "{log}"
    );
}

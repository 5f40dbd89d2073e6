//! What the command says about files: `info`, and project files with the usual slips.

use assert_cmd::Command;
use std::fs;
use std::path::{Path, PathBuf};

fn stonewise() -> Command {
    Command::new(env!("CARGO_BIN_EXE_stonewise"))
}

fn testdata(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../testdata")
        .join(name)
}

/// Exit code, standard output and standard error of `info`.
fn info(paths: &[PathBuf]) -> (i32, String, String) {
    let output = stonewise().arg("info").args(paths).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (
        output.status.code().unwrap(),
        text(output.stdout),
        text(output.stderr),
    )
}

#[test]
fn info_goes_on_after_a_bad_file_and_names_what_is_wrong_with_it() {
    let bad = [
        "layer_sizes.laz",
        "claim.png",
        "ply_huge_element_at_eof.ply",
        "laz_2e60.laz",
        "bomb.xml",
    ];
    let mut paths: Vec<PathBuf> = bad.iter().map(|name| testdata("hostile").join(name)).collect();
    paths.push(testdata("clouds/little.ply"));
    let (code, out, log) = info(&paths);
    assert_eq!(code, 1);
    assert!(out.contains("little.ply") && out.contains("PLY,"), "{out}");
    for name in bad {
        let about: Vec<&str> = log.lines().filter(|line| line.contains(name)).collect();
        assert_eq!(about.len(), 1, "{name}: {log}");
        assert!(!about[0].contains("not a camera file"), "{log}");
    }
    assert!(log.contains("5 of 6 cannot be used"), "{log}");
    assert_eq!(log.lines().count(), 6, "{log}");
}

#[test]
fn info_tells_what_pictures_and_masks_there_are() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["photos", "labels"] {
        fs::create_dir(folder.path().join(name)).unwrap();
    }
    let photo = stonewise_core::raster::Raster::filled(64, 48, [1u8, 2, 3]);
    let labels = stonewise_core::raster::Raster::from_vec(64, 48, (0..64 * 48).map(|i| i % 3).collect());
    let jpeg = folder.path().join("photos/one.jpg");
    stonewise_io::image_io::write_jpeg(&jpeg, &photo, 90).unwrap();
    fs::write(folder.path().join("photos/two.jpg"), "no picture").unwrap();
    let png = folder.path().join("labels/one.png");
    stonewise_io::masks::write_label_png(&png, &labels.unwrap()).unwrap();
    let masks = folder.path().join("masks.json");
    fs::write(
        &masks,
        "{\"images\": [{\"id\": 1, \"file_name\": \"one.jpg\", \"width\": 64, \"height\": 48}], \"annotations\": [], \"categories\": []}",
    )
    .unwrap();
    let (code, out, log) = info(&[
        folder.path().join("photos"),
        folder.path().join("labels"),
        jpeg,
        png,
        masks,
    ]);
    assert_eq!((code, log.as_str()), (0, ""));
    for expected in [
        "  1 photo of 64 x 48 px\n",
        ": cannot read the image",
        "  1 label image of 64 x 48 px\n",
        "  photo, 64 x 48 px\n",
        "  label image, 64 x 48 px, 2 instances\n",
        "  masks (COCO) of ",
    ] {
        assert!(out.contains(expected), "{expected} is not in\n{out}");
    }
    let (code, _, log) = info(&[testdata("coco_ap")]);
    assert_eq!(code, 1);
    assert!(
        log.contains("neither photos, label images nor a COLMAP model"),
        "{log}"
    );
}

#[test]
fn info_tells_what_a_surveyor_asks() {
    let (code, out, log) = info(&[
        testdata("clouds/las14_format7_extra.laz"),
        testdata("clouds/two_scans.ptx"),
        testdata("photos/exif.jpg"),
    ]);
    assert_eq!((code, log.as_str()), (0, ""));
    // Coordinates, fields and sources as testdata/clouds/generate.py writes them.
    for expected in [
        "  LAZ 1.4, point format 7, 120 points\n",
        "  coordinates in steps of [0.001, 0.001, 0.001] m from [350000.0, 5650000.0, 0.0] m\n",
        "intensity 0 to 833",
        "gps_time 100000 to 100017",
        "classification 0 to 6",
        "reflectance -11.9 to 0",
        "  source 900: 1 point",
        "  and 100 more sources\n",
        "  CRS ETRS89 / UTM zone 32N, without a code\n",
        "  PTX, 132 points\n  12 of them have no position\n",
        "  scan 2: 55 points, scanner at (350020.000, 5649980.000, 99.250)\n",
        "  no CRS\n",
        "  DJI FC6310, f 8.8 mm, 24 mm on 35 mm film\n  taken 2025-04-12 09:31:02\n",
        "  GPS -51.0879833, 7.7360556, -12.3 m\n",
    ] {
        assert!(out.contains(expected), "{expected} is not in\n{out}");
    }
    let output = stonewise()
        .args(["info", "--json"])
        .arg(testdata("clouds/las12_format3.las"))
        .arg(testdata("clouds/two_scans.ptx"))
        .arg(testdata("cameras/pix4d/dam_calibrated_camera_parameters.txt"))
        .output()
        .unwrap();
    let all: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(all[0]["epsg"], 25832);
    assert_eq!(
        (all[0]["points"].as_u64(), all[0]["unit_m"].as_f64()),
        (Some(120), Some(1.0))
    );
    assert_eq!(
        all[0]["rounding"]["scale_m"],
        serde_json::json!([0.001, 0.001, 0.001])
    );
    assert_eq!(
        all[1]["scans"][0]["scanner"],
        serde_json::json!([349_990.0, 5_650_010.0, 101.5])
    );
    assert_eq!(
        (&all[2]["kind"], &all[2]["photos"][1]["focal_px"][0]),
        (&"cameras".into(), &2900.5.into())
    );
    let spacing = all[0]["spacing_m"].as_f64().unwrap();
    // Neighbours lie 1 cm and 2 cm apart in x and y, and up to 97 mm in z.
    assert!((0.0223..0.06).contains(&spacing), "{spacing}");
}

#[test]
fn info_does_not_repeat_a_false_box() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.las");
    let mut bytes = fs::read(testdata("clouds/las12_format3.las")).unwrap();
    // The highest and the lowest z of the header, a thousand times too large.
    for place in [211, 219] {
        let z = f64::from_le_bytes(bytes[place..place + 8].try_into().unwrap());
        bytes[place..place + 8].copy_from_slice(&(z * 1000.0 + 1.0).to_le_bytes());
    }
    let (_, sound, _) = info(&[testdata("clouds/las12_format3.las")]);
    fs::write(&path, &bytes).unwrap();
    let (code, out, _) = info(&[path]);
    assert_eq!(code, 0);
    let extent = |text: &str| text.lines().find(|l| l.starts_with("  from")).map(str::to_owned);
    assert_eq!(extent(&out), extent(&sound));
    assert!(out.contains("  its header is wrong: it says from"), "{out}");
    assert!(!sound.contains("wrong"), "{sound}");
}

/// An E57 file with one photo that has a pose, and `more` photos that have none.
fn e57_with_photos(path: &Path, more: usize) {
    let picture = path.with_extension("png");
    let pixels = stonewise_core::raster::Raster::filled(40, 30, [1u8, 2, 3]);
    stonewise_io::image_io::write_png_rgb(&picture, &pixels).unwrap();
    let mut file = e57::E57Writer::from_file(path, "file").unwrap();
    for i in 0..=more {
        let mut image = file.add_image(&format!("image {i}")).unwrap();
        let lens = e57::PinholeImageProperties {
            width: 40,
            height: 30,
            focal_length: 0.01,
            pixel_width: 0.0005,
            pixel_height: 0.0005,
            principal_x: 20.0,
            principal_y: 15.0,
        };
        let bytes = fs::read(&picture).unwrap();
        image
            .add_pinhole(e57::ImageFormat::Png, &mut bytes.as_slice(), lens, None)
            .unwrap();
        if i == 0 {
            let (x, y, z) = (1.0, 2.0, 3.0);
            image.set_transform(e57::Transform {
                translation: e57::Translation { x, y, z },
                ..e57::Transform::default()
            });
        }
        image.finalize().unwrap();
    }
    file.finalize().unwrap();
}

#[test]
fn photos_in_e57_files_become_images_and_cameras_of_a_project() {
    let folder = tempfile::tempdir().unwrap();
    let scan = folder.path().join("scan.e57");
    let out = folder.path().join("photos");
    let photos = |scan: &Path| {
        let mut command = stonewise();
        let output = command
            .args(["info", "--unpack-photos"])
            .arg(scan)
            .arg("--out")
            .arg(&out)
            .output();
        let output = output.unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (output.status.code(), text(output.stdout), text(output.stderr))
    };
    let (code, _, log) = photos(&testdata("clouds/two_scans.e57"));
    assert_eq!(code, Some(1), "{log}");
    assert!(
        log.contains("no images inside") && log.contains("two_scans.e57"),
        "{log}"
    );
    let (code, _, log) = photos(&testdata("hostile/lie.jpg"));
    assert!(code == Some(1) && log.contains("not an E57 file"), "{log}");
    assert!(!out.exists());

    e57_with_photos(&scan, 0);
    let (code, said, _) = info(std::slice::from_ref(&scan));
    let expected = format!(
        "  contains 1 photo; to unpack them: stonewise info --unpack-photos {}\n",
        scan.display()
    );
    assert!(code == 0 && said.contains(&expected), "{said}");
    let (code, said, log) = photos(&scan);
    assert_eq!(code, Some(0), "{log}");
    let line = |key: &str, name: &str| format!("{key} = \"{}/{name}\"\n", out.display()).replace('\\', "/");
    for expected in [
        "1 photo of 40 x 30 px\n",
        &line("images", "images"),
        &line("cameras", "colmap"),
    ] {
        assert!(said.contains(expected), "{expected} is not in {said}");
    }
    let (_, said, _) = info(&[out.join("colmap")]);
    assert!(
        said.contains("  photo_001.png: 40 x 30 px, f 20.0 px, at (1.000, 2.000, 3.000)\n"),
        "{said}"
    );

    // The same scan may come again; what it lacks is said.
    e57_with_photos(&scan, 2);
    let (code, said, log) = photos(&scan);
    assert!(
        code == Some(3) && said.contains("left out: 2 images without a pose\n"),
        "{said}{log}"
    );
    let output = stonewise().args(["info", "--json"]).arg(&scan).output().unwrap();
    let all: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let expected = serde_json::json!({ "photos": 1, "panoramas": 0, "not_usable": 2 });
    assert_eq!(all[0]["images"], expected);
    // Another scan may not.
    let other = folder.path().join("other.e57");
    e57_with_photos(&other, 0);
    let (code, _, log) = photos(&other);
    assert!(code == Some(2) && log.contains("--force"), "{log}");
}

#[test]
fn usual_slips_in_project_files_are_wrong_usage_with_the_fix() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stonewise.toml");
    let whole = |clouds: &str| {
        let rest = "images = \".\"\ncameras = \".\"\n";
        let epoch = |name: &str, clouds: &str| format!("[[epochs]]\nname = \"{name}\"\n{clouds}\n{rest}");
        format!(
            "[project]\nname = \"a\"\n{}{}",
            epoch("b", clouds),
            epoch("c", "clouds = [\".\"]")
        )
    };
    let slashes = "use / or single quotes in paths";
    for (clouds, expected) in [
        ("clouds = \"a.laz\"", "write it as a list: clouds = [\"a.laz\"]"),
        ("clouds = [\"C:\\epoch2\"]", slashes),
        ("clouds = [\"C:\\wall.laz\"]", slashes),
        ("clouds = [\"C:\\new.laz\"]", slashes),
    ] {
        fs::write(&path, whole(clouds)).unwrap();
        // The folder stands for the project file in it.
        for given in [folder.path(), &path] {
            let output = stonewise()
                .arg("run")
                .arg(given)
                .args(["--out", "unused"])
                .output()
                .unwrap();
            let log = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(2), "{log}");
            assert!(
                log.contains(expected) && log.contains("stonewise.toml:5: "),
                "{clouds}: {log}"
            );
        }
    }
    let text = whole("clouds = [\".\"]").replacen("[[epochs]]", "crs = \"EPSG:1\"\n[[epochs]]", 1);
    fs::write(&path, text).unwrap();
    let output = stonewise()
        .arg("run")
        .arg(&path)
        .args(["--out", "unused"])
        .output()
        .unwrap();
    let log = String::from_utf8(output.stderr).unwrap();
    assert!(
        log.contains(":3: crs: EPSG:1 is not among the systems known by their number"),
        "{log}"
    );
}

/// Two clouds of a small wall with relief, the second of which may be changed.
fn two_clouds(folder: &Path, change: impl Fn([f64; 3]) -> [f64; 3]) {
    let wall = |seed: u32| -> Vec<[f64; 3]> {
        let step = 0.02;
        let height =
            |i: u32, j: u32| f64::from((i / 15 * 37 + j / 10 * 101 + i / 15 * (j / 10) * 53) % 17) * 2e-3;
        let point = |k: u32| {
            let (i, j) = (k % 150, k / 150);
            let jitter = f64::from((k * 7919 + seed) % 13) * 1e-4;
            [
                height(i, j) + jitter,
                f64::from(i) * step - 1.5,
                f64::from(j) * step,
            ]
        };
        (0..150 * 75).map(point).collect()
    };
    let write = |name: &str, points: Vec<[f64; 3]>| {
        let lines: Vec<String> = points
            .iter()
            .map(|[x, y, z]| format!("{x:.5} {y:.5} {z:.5}"))
            .collect();
        fs::write(folder.join(name), lines.join("\n")).unwrap();
    };
    write("a.xyz", wall(0));
    write("b.xyz", wall(5).into_iter().map(change).collect());
}

#[test]
fn check_takes_scans_as_run_does() {
    let folder = tempfile::tempdir().unwrap();
    let check = |clouds: &[&str]| {
        let mut command = stonewise();
        command.current_dir(folder.path()).arg("check").args(clouds);
        let output = command.output().unwrap();
        let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
        (output.status.code(), text.concat())
    };
    two_clouds(folder.path(), |p| p);
    let (code, said) = check(&["a.xyz", "b.xyz"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(
        said.contains("11250 points") && !said.contains("mirror"),
        "{said}"
    );
    assert!(check(&["a.xyz"]).1.contains("a single scan shows no motion"));
    assert_eq!(
        fs::read_dir(folder.path()).unwrap().count(),
        2,
        "nothing is written"
    );
    // Left and right exchanged.
    two_clouds(folder.path(), |[x, y, z]| [x, -y, z]);
    let (code, said) = check(&["a.xyz", "b.xyz"]);
    assert!(code == Some(3) && said.contains("[mirrored-cloud]"), "{said}");
    two_clouds(folder.path(), |[x, y, z]| [y, z, x]);
    let (code, said) = check(&["b.xyz", "b.xyz"]);
    assert!(code == Some(3) && said.contains("[lies-flat]"), "{said}");
}

#[test]
fn init_twice_keeps_the_project_and_run_offers_init() {
    let folder = tempfile::tempdir().unwrap();
    let said = |arguments: &[&str]| {
        let mut command = stonewise();
        command.current_dir(folder.path()).args(arguments);
        String::from_utf8(command.output().unwrap().stderr).unwrap()
    };
    let log = said(&["run", ".", "--out", "results"]);
    assert!(
        log.contains("stonewise.toml: no project file") && log.contains("`stonewise init .`"),
        "{log}"
    );
    two_clouds(folder.path(), |p| p);
    said(&["init", "."]);
    let log = said(&["init", "."]);
    assert!(log.contains("stays as it is") && !log.contains("remove"), "{log}");
}

#[test]
fn a_project_file_that_is_missing_or_no_text_is_wrong_usage() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stonewise.toml");
    let run = |given: &Path| {
        let mut command = stonewise();
        command.arg("run").arg(given).args(["--out", "unused"]);
        let output = command.output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    // A folder without a project file, and a file that is not there.
    for given in [folder.path().to_path_buf(), folder.path().join("none.toml")] {
        let (code, log) = run(&given);
        assert_eq!(code, Some(2), "{log}");
        assert!(
            log.contains("no project file is there") && log.contains("stonewise init"),
            "{log}"
        );
    }
    // A name in Latin 1.
    fs::write(&path, b"[project]\nname = \"Stra\xdfe\"\n").unwrap();
    let (code, log) = run(&path);
    assert_eq!(code, Some(2), "{log}");
    assert!(
        log.contains("stonewise.toml:2: ") && log.contains("save the file as UTF-8"),
        "{log}"
    );
}

#[cfg(unix)]
#[test]
fn a_read_that_never_ends_is_ended_by_a_signal() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("endless.xyz");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
    assert!(made.success());
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_stonewise"))
        .arg("info")
        .arg(&pipe)
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_millis(300));
    let signal = std::process::Command::new("kill")
        .arg(child.id().to_string())
        .status();
    assert!(signal.unwrap().success());
    let ended = (0..100).any(|_| {
        std::thread::sleep(std::time::Duration::from_millis(50));
        child.try_wait().unwrap().is_some()
    });
    let _ = child.kill();
    assert!(ended);
}

#[test]
fn segment_refuses_options_that_a_project_would_ignore() {
    let folder = tempfile::tempdir().unwrap();
    let project = folder.path().join("stonewise.toml");
    fs::write(&project, "[project]\nname = \"a\"\n").unwrap();
    for (option, value, advice) in [
        ("--model", "my.safetensors", "`model` in its section [segment]"),
        ("--scales", "1,0.5", "`scales` in its section [segment.tiling]"),
        (
            "--min-score",
            "0.4",
            "`min_score` in its section [segment.tiling]",
        ),
        ("--reference", "masks.json", "the folder of its photos"),
    ] {
        let out = folder.path().join("out");
        let output = stonewise()
            .args(["detector", "segment"])
            .arg(&project)
            .args([option, value, "--out"])
            .arg(&out)
            .output()
            .unwrap();
        let log = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{log}");
        assert!(
            log.contains(option) && log.contains(advice) && log.contains("stonewise.toml"),
            "{log}"
        );
        assert!(!out.exists(), "{option}");
    }
}

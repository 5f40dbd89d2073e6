//! Every reader, with the files that it is tried on.

use super::mutate::mutate;
use super::random::Random;
use super::repair;
use super::seeds::{PROJECT, PROJECT_FILES, Seed, testdata, testdata_path, text, written};
use nalgebra::Point3;
use std::fs;
use std::path::Path;
use stonewise::Project;
use stonewise_core::raster::Raster;
use stonewise_io::cameras::{MapFrame, find_photos, read_cameras_on_map};
use stonewise_io::cloud::{
    CloudError, CloudFormat, LabelColumns, PointChunk, PointLabel, cloud_info, measure_cloud, read_mesh,
    write_labelled,
};
use stonewise_io::crs::{Crs, Geodetic, Geoid, MapSystem};
use stonewise_io::image_io::{image_size, read_rgb, write_jpeg, write_png_rgb};
use stonewise_io::masks::{CocoMasks, LabelFolder, ValidRegions, write_label_png};

type Read = fn(&Path) -> Result<(), String>;

/// A reader.
pub struct Target {
    pub name: &'static str,
    /// Reads a file through every door of this kind.
    pub read: Read,
    seeds: Vec<Seed>,
    is_text: bool,
    /// Makes checksums right.
    repair: Option<fn(&mut [u8])>,
    /// Sound files that lie beside the input.
    beside: Vec<Seed>,
}

impl Target {
    fn of_bytes(name: &'static str, seeds: Vec<Seed>, read: Read) -> Self {
        Self {
            name,
            read,
            seeds,
            is_text: false,
            repair: None,
            beside: Vec::new(),
        }
    }

    fn of_text(name: &'static str, seeds: Vec<Seed>, read: Read) -> Self {
        Self {
            is_text: true,
            ..Self::of_bytes(name, seeds, read)
        }
    }

    fn repaired(self, repair: fn(&mut [u8])) -> Self {
        Self {
            repair: Some(repair),
            ..self
        }
    }

    fn beside(self, beside: Vec<Seed>) -> Self {
        Self { beside, ..self }
    }

    /// Writes the files that lie beside the inputs.
    pub fn prepare(&self, home: &Path) {
        for seed in &self.beside {
            fs::write(home.join(&seed.name), &seed.bytes).unwrap();
        }
        fs::create_dir_all(home.join("images")).unwrap();
    }

    /// A changed seed; one in twenty is left as it is.
    pub fn input(&self, random: &mut Random) -> (String, Vec<u8>) {
        let seed = random.of(&self.seeds);
        let mut bytes = seed.bytes.clone();
        if !random.one_in(20) {
            mutate(&mut bytes, &random.of(&self.seeds).bytes, self.is_text, random);
            if let Some(repair) = self.repair.filter(|_| !random.one_in(4)) {
                repair(&mut bytes);
            }
        }
        (seed.name.clone(), bytes)
    }
}

/// All readers.
pub fn targets() -> Vec<Target> {
    vec![
        Target::of_bytes(
            "las",
            testdata(&[
                "clouds/las10_format1.las",
                "clouds/las11_format0.las",
                "clouds/las12_format3.las",
                "clouds/las13_format1.laz",
                "clouds/las14_format8.las",
                "hostile/las_2e60.las",
            ]),
            las,
        ),
        Target::of_bytes(
            "laz",
            testdata(&[
                "clouds/las12_format2.laz",
                "clouds/las14_format6.laz",
                "clouds/las14_format7_extra.laz",
                "hostile/layer_sizes.laz",
                "hostile/laz_2e60.laz",
            ]),
            las,
        ),
        Target::of_bytes("copc", testdata(&["clouds/chunks.copc.laz"]), las),
        Target::of_bytes("e57", testdata(&["clouds/two_scans.e57"]), las).repaired(repair::e57),
        Target::of_bytes("ply", testdata(&["clouds/little.ply", "clouds/big.ply"]), ply),
        Target::of_text("ply text", ply_texts(), ply),
        Target::of_text("ptx", testdata(&["clouds/two_scans.ptx"]), las),
        Target::of_text(
            "xyz",
            testdata(&[
                "clouds/plain.xyz",
                "clouds/tabs.txt",
                "clouds/header.csv",
                "clouds/german.csv",
                "clouds/count.pts",
            ]),
            cloud,
        ),
        Target::of_text("metashape", metashape(), map_cameras),
        Target::of_text(
            "colmap text",
            testdata(&["cameras/colmap_txt/images.txt"]),
            cameras,
        )
        .beside(testdata(&["cameras/colmap_txt/cameras.txt"])),
        Target::of_text(
            "pix4d",
            testdata(&["cameras/pix4d/dam_calibrated_camera_parameters.txt"]),
            cameras,
        ),
        Target::of_text(
            "realitycapture",
            testdata(&[
                "cameras/realitycapture/cameras.csv",
                "cameras/realitycapture/opencv.csv",
                "cameras/realitycapture/xmp/brown3t2.xmp",
            ]),
            cameras,
        )
        .beside(vec![photo_named("none.jpg"), photo_named("brown3t2.jpg")]),
        Target::of_bytes(
            "colmap",
            testdata(&["cameras/colmap_bin/cameras.bin", "cameras/colmap_bin/images.bin"]),
            cameras,
        )
        .beside(testdata(&[
            "cameras/colmap_bin/cameras.bin",
            "cameras/colmap_bin/images.bin",
        ])),
        Target::of_text("opensfm", testdata(&["cameras/opensfm.json"]), cameras),
        Target::of_bytes(
            "geoid",
            testdata(&["crs/geoid.gtx", "crs/geoid_area.tif", "crs/geoid_point.tif"]),
            geoid,
        ),
        Target::of_text("coco", vec![text("masks.json", MASKS)], coco),
        Target::of_text("regions", vec![text("regions.json", REGIONS)], regions),
        Target::of_bytes("labels", label_images(), labels).repaired(repair::png),
        Target::of_bytes("photos", photos(), photo).repaired(repair::png),
        Target::of_text("project", vec![text("stonewise.toml", PROJECT)], project)
            .beside(PROJECT_FILES.map(|name| text(name, "")).into()),
        Target::of_bytes("init", folder_plans(), init),
    ]
}

/// See `init`: two epochs with clouds and photos, and files without folders.
fn folder_plans() -> Vec<Seed> {
    ["Pe@QgRx@PRx", "abcdefghijklmnopqrstuvwxyz"]
        .map(|plan| text("folders.txt", plan))
        .into()
}

/// Polygons, and runs as numbers and as text: 40 pixels, then 20 of the mask, then 140.
const MASKS: &str = r#"{"images": [{"id": 1, "file_name": "images/0001.jpg", "width": 20, "height": 10}],
 "categories": [{"id": 1, "name": "stone"}], "annotations": [
 {"id": 1, "image_id": 1, "category_id": 1, "segmentation": [[0, 0, 9, 0, 9, 8, 0, 8], [12, 1, 15, 1, 15, 4]]},
 {"id": 2, "image_id": 1, "category_id": 1, "iscrowd": 1, "segmentation": {"size": [10, 20], "counts": [40, 20, 140]}},
 {"id": 3, "image_id": 1, "category_id": 1, "segmentation": {"size": [10, 20], "counts": "X1d0\\4"}}]}"#;

const REGIONS: &str = r#"{"images/0001.jpg": {"width": 64, "height": 48, "valid": [
 {"outer": [0, 0, 60, 0, 60, 40, 0, 40], "holes": [[2, 2, 9, 2, 9, 9]]}]}}"#;

fn ply_texts() -> Vec<Seed> {
    let mut seeds = testdata(&[
        "clouds/text.ply",
        "hostile/ply_element_without_properties.ply",
        "hostile/ply_huge_element_at_eof.ply",
    ]);
    let mesh = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                element face 2\nproperty list uchar int vertex_indices\nend_header\n\
                0 0 0\n1 0 0\n1 2 0\n0 2 0.5\n4 0 1 2 3\n3 3 1 0\n";
    seeds.push(text("mesh.ply", mesh));
    seeds
}

fn metashape() -> Vec<Seed> {
    let mut seeds = testdata(&["cameras/metashape.xml", "hostile/bomb.xml", "hostile/xxe.xml"]);
    // Earth-centred poses, near Bonn.
    let camera = "<camera id=\"0\" sensor_id=\"0\" label=\"one.jpg\"><transform>1 0 0 3980000 0 1 0 498000 0 0 1 4944000 \
                  0 0 0 1</transform></camera>";
    let crs = Crs::parse("EPSG:25832").unwrap().wkt.replace('"', "&quot;");
    let chunk = format!(
        "<document><chunk label=\"a\"><sensors><sensor id=\"0\" type=\"frame\"><resolution width=\"40\" height=\"30\"/>\
         <calibration type=\"frame\" class=\"adjusted\"><f>30</f></calibration></sensor></sensors>\
         <cameras>{camera}</cameras><reference>{crs}</reference></chunk></document>"
    );
    seeds.push(text("earth.xml", &chunk));
    seeds
}

fn label_images() -> Vec<Seed> {
    let values = (0..64 * 48).map(|i| (i % 64) / 9 * 40).collect();
    let labels = Raster::from_vec(64, 48, values).unwrap();
    let mut seeds = testdata(&["hostile/claim.png"]);
    seeds.push(written("photo.png", |path| {
        write_label_png(path, &labels).unwrap()
    }));
    seeds
}

fn photo_named(name: &str) -> Seed {
    let picture = Raster::filled(40, 30, [99; 3]);
    written(name, |path| write_jpeg(path, &picture, 90).unwrap())
}

fn photos() -> Vec<Seed> {
    let pixels = (0..64 * 48).map(|i| [i as u8, (i / 64) as u8, 99]).collect();
    let picture = Raster::from_vec(64, 48, pixels).unwrap();
    let mut seeds = testdata(&["hostile/lie.jpg"]);
    seeds.push(written("photo.jpg", |path| {
        write_jpeg(path, &picture, 90).unwrap()
    }));
    seeds.push(written("photo.png", |path| {
        write_png_rgb(path, &picture).unwrap()
    }));
    seeds
}

fn line(error: impl std::fmt::Display) -> String {
    error.to_string()
}

fn cloud(path: &Path) -> Result<(), String> {
    let info = cloud_info(path).map_err(line)?;
    let mut bounds = info.bounds;
    // Of other formats `cloud_info` has read every point already.
    if info.format == CloudFormat::Las {
        let (summary, measured) = measure_cloud(path).map_err(line)?;
        assert_eq!(info.records, summary.records);
        bounds = measured;
    }
    assert!(bounds.is_none_or(|b| b.min.iter().chain(b.max.iter()).all(|c| c.is_finite())));
    if let Some(crs) = info.crs {
        let _ = (Crs::parse(&crs), MapSystem::parse(&crs));
    }
    Ok(())
}

/// Copies a cloud as well.
fn las(path: &Path) -> Result<(), String> {
    cloud(path)?;
    let nothing = |chunk: &PointChunk| Ok::<_, CloudError>(vec![PointLabel::default(); chunk.len()]);
    let copy = path.with_file_name("copy.laz");
    write_labelled(path, &copy, LabelColumns::Stone, nothing).map_err(line)?;
    cloud(&copy)
}

fn ply(path: &Path) -> Result<(), String> {
    let _ = read_mesh(path);
    cloud(path)
}

/// Cameras whose poses may be georeferenced.
fn map_cameras(path: &Path) -> Result<(), String> {
    let on_map = MapFrame {
        crs: Some("EPSG:25832".to_owned()),
        false_origin: [450_000.0, 5_600_000.0, 0.0],
        geoid: None,
    };
    let _ = read_cameras_on_map(path, None, &on_map);
    cameras(path)
}

fn cameras(path: &Path) -> Result<(), String> {
    let file = read_cameras_on_map(path, None, &MapFrame::default()).map_err(line)?;
    for view in &file.views {
        assert!(
            view.centre().iter().all(|c| c.is_finite()),
            "camera {} is nowhere",
            view.name
        );
        let ahead = view.cam_from_world.inverse() * Point3::new(0.1, -0.2, 5.0);
        let _ = view.project(&ahead);
    }
    let _ = find_photos(&path.with_file_name("images"), &file);
    Ok(())
}

fn geoid(path: &Path) -> Result<(), String> {
    let geoid = Geoid::read(path).map_err(line)?;
    for (latitude, longitude) in [(0.89, 0.135), (-1.5, 6.0), (f64::NAN, 0.1)] {
        let _ = geoid.height_m(&Geodetic {
            latitude,
            longitude,
            height_m: 0.0,
        });
    }
    Ok(())
}

fn coco(path: &Path) -> Result<(), String> {
    let masks = CocoMasks::open(path).map_err(line)?;
    for photo in masks.photos().filter(|p| p.width.max(p.height) < 4000) {
        masks
            .labels_for(photo.file_name, photo.width, photo.height)
            .map_err(line)?;
    }
    Ok(())
}

fn regions(path: &Path) -> Result<(), String> {
    let regions = ValidRegions::open(path).map_err(line)?;
    regions.outside("images/0001.jpg", 64, 48).map_err(line)?;
    Ok(())
}

fn labels(path: &Path) -> Result<(), String> {
    let folder = path.parent().unwrap();
    let masks = LabelFolder::open(folder).map_err(line)?;
    let name = path.with_extension("jpg");
    let found = masks.labels_for(&name.to_string_lossy(), 64, 48);
    // The other seed is found beside it where this one has another name.
    found.map(|_| ()).map_err(line)?;
    stonewise_io::masks::read_label_png(path)
        .map(|_| ())
        .map_err(line)
}

fn photo(path: &Path) -> Result<(), String> {
    let size = image_size(path).map_err(line)?;
    let picture = read_rgb(path).map_err(line)?;
    assert_eq!(size, (picture.width(), picture.height()));
    Ok(())
}

fn project(path: &Path) -> Result<(), String> {
    Project::read(path).map(|_| ()).map_err(line)
}

/// Makes a folder as the bytes of the file say, and a project of it.
fn init(path: &Path) -> Result<(), String> {
    const NAMES: [&str; 16] = [
        "epoch1",
        "epoch2",
        "images",
        "masks",
        "results",
        "a.laz",
        "b.e57",
        "c.txt",
        "one.jpg",
        "one.png",
        "cameras.xml",
        "reconstruction.json",
        "masks.json",
        "images.txt",
        "=a\"b'.ply",
        "\u{fc}\u{308} \n\\.xyz",
    ];
    let home = tempfile::tempdir_in(path.parent().unwrap()).unwrap();
    let mut folder = home.path().to_owned();
    for byte in fs::read(path).unwrap().into_iter().take(40) {
        let name = folder.join(NAMES[usize::from(byte % 16)]);
        match byte / 16 % 4 {
            0 => folder = home.path().to_owned(),
            1 if fs::create_dir_all(&name).is_ok() => folder = name,
            2 => drop(fs::copy(testdata_path("clouds/plain.xyz"), &name)),
            _ => drop(fs::write(&name, "")),
        }
    }
    stonewise::init(home.path()).map(|_| ()).map_err(line)?;
    let _ = Project::read(home.path());
    Ok(())
}

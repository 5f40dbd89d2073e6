//! Damaged and impossible cloud files: an error each time, never a panic, never a silent loss.

use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::Point3;
use stonewise_io::cloud::{
    CloudError, Dimension, ExtraColumn, LabelColumns, PointChunk, PointLabel, ReadSummary, cloud_info,
    read_cloud, write_labelled, write_points_laz,
};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../testdata/clouds")
        .join(name)
}

fn read(path: &Path) -> Result<(ReadSummary, Vec<Point3<f64>>), CloudError> {
    let mut all = Vec::new();
    let summary = read_cloud(path, 50, |chunk| {
        all.extend(&chunk.positions);
        Ok::<(), CloudError>(())
    })?;
    Ok((summary, all))
}

const BINARY: [&str; 8] = [
    "las10_format1.las",
    "las12_format2.laz",
    "las12_format3.las",
    "las14_format7_extra.laz",
    "chunks.copc.laz",
    "two_scans.e57",
    "little.ply",
    "big.ply",
];
/// A cut in the middle of a number is no error in them; whole lines are missed.
const TEXT: [&str; 2] = ["two_scans.ptx", "count.pts"];

#[test]
fn a_file_that_is_cut_off_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    for name in BINARY {
        let whole = fs::read(fixture(name)).unwrap();
        let (_, points) = read(&fixture(name)).unwrap();
        let path = folder.path().join(name);
        let mut errors = 0;
        for length in (0..whole.len()).step_by(41) {
            fs::write(&path, &whole[..length]).unwrap();
            match read(&path) {
                // What comes last may not be needed: padding of a table, faces of a mesh.
                Ok((_, read)) => assert!(read == points && length + 100 > whole.len(), "{name}: {length}"),
                Err(e) => {
                    assert!(e.to_string().contains(name), "{e}");
                    errors += 1;
                }
            }
            let _ = cloud_info(&path);
        }
        assert!(errors > whole.len() / 41 - 3, "{name}");
    }
}

#[test]
fn a_text_that_lacks_its_last_lines_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    for name in TEXT {
        let whole = fs::read_to_string(fixture(name)).unwrap();
        let path = folder.path().join(name);
        let starts = whole.match_indices('\n').map(|(at, _)| at + 1);
        for length in starts.filter(|&at| at < whole.len()).step_by(7) {
            fs::write(&path, &whole[..length]).unwrap();
            let error = match read(&path) {
                Err(error) => error.to_string(),
                // What ends after a scan of PTX looks whole.
                Ok((summary, _)) => {
                    assert!(name.ends_with("ptx") && summary.records == 77, "{name}: {length}");
                    continue;
                }
            };
            assert!(error.contains(name), "{error}");
            let _ = cloud_info(&path);
        }
    }
}

#[test]
fn damaged_texts_do_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.laz");
    for name in TEXT {
        let whole = fs::read(fixture(name)).unwrap();
        let path = folder.path().join(name);
        for place in (0..400).chain((400..whole.len()).step_by(71)) {
            let mut bytes = whole.clone();
            bytes[place] = b"09-.e \nx"[place % 8];
            fs::write(&path, &bytes).unwrap();
            let _ = read(&path);
            let _ = cloud_info(&path);
            let _ = write_labelled(&path, &out, LabelColumns::Stone, no_labels);
        }
    }
}

fn no_labels(chunk: &PointChunk) -> Result<Vec<PointLabel>, CloudError> {
    Ok(vec![PointLabel::default(); chunk.len()])
}

#[test]
fn damaged_bytes_do_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.laz");
    for name in BINARY {
        let whole = fs::read(fixture(name)).unwrap();
        let path = folder.path().join(name);
        // A third of the header, where the sizes are, and some of the rest.
        for place in (0..400).step_by(3).chain((400..whole.len()).step_by(71)) {
            let mut bytes = whole.clone();
            bytes[place] ^= [0xff, 0x80, 0x01][place % 3];
            fs::write(&path, &bytes).unwrap();
            let _ = read(&path);
            let _ = write_labelled(&path, &out, LabelColumns::Stone, no_labels);
        }
    }
}

fn failure(folder: &Path, name: &str, content: &str) -> String {
    let path = folder.join(name);
    fs::write(&path, content).unwrap();
    let error = read(&path).unwrap_err().to_string();
    error.replace(&format!("{}/", folder.display()), "")
}

#[test]
fn errors_name_the_file_the_line_and_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let header =
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n";
    for (name, content, expected) in [
        ("a.las", "", "a.las: the file is empty"),
        (
            "a.laz",
            "LASX and more",
            "a.laz: not a laz file: it does not begin with \"LASF\"",
        ),
        (
            "a.e57",
            "nonsense",
            "a.e57: not a e57 file: it does not begin with \"ASTM-E57\"",
        ),
        (
            "a.xyz",
            "1 2 3\n4 5\n",
            "a.xyz, line 2: 2 columns, but column 3 is needed",
        ),
        (
            "a.xyz",
            "1 2 3\n\n4 5 b\n",
            "a.xyz, line 3: \"b\" in column 3 is not a number",
        ),
        (
            "a.xyz",
            "a b c\n1 2 3\n",
            "a.xyz, line 1: neither three numbers nor a header with columns x, y and z",
        ),
        (
            "a.csv",
            "x,y,z\nx,y,z\n",
            "a.csv, line 2: not a point: \"x\" in column 1 is not a number",
        ),
        (
            "a.ply",
            "ply\nformat ascii 2.0\nend_header\n",
            "a.ply, line 2: not a line of a ply header: \"format ascii 2.0\"",
        ),
        (
            "a.ply",
            "ply\nformat ascii 1.0\nend_header\n",
            "a.ply: the ply header has no element vertex",
        ),
        (
            "a.ply",
            "ply\nend_header\n",
            "a.ply, line 2: the header has no known format line before this",
        ),
        (
            "a.ply",
            "ply\nformat ascii 1.0\nelement vertex many\n",
            "a.ply, line 3: \"many\" is not a count",
        ),
        (
            "a.ply",
            "ply\nformat ascii 1.0\nproperty float x\n",
            "a.ply, line 3: a property before any element",
        ),
        (
            "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty half x\n",
            "a.ply, line 4: unknown type of property \"half\"",
        ),
        (
            "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty list float int x\n",
            "a.ply, line 4: the length of a list must be an integer",
        ),
        (
            "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n",
            "a.ply: the vertices of the ply header have no numbers x, y and z",
        ),
        ("a.ply", header, "a.ply, line 6: the header has no end_header"),
    ] {
        assert_eq!(failure(f, name, content), expected);
    }
    let cut = format!("{header}end_header\n1 2 3\n");
    assert_eq!(
        failure(f, "a.ply", &cut),
        "a.ply is cut off: it holds 1 of 2 vertices"
    );
    let short = format!("{header}end_header\n1 2\n");
    assert_eq!(
        failure(f, "a.ply", &short),
        "a.ply, line 8: the line ends before its property \"z\""
    );
    let ptx = "1\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n5 6 7 1\n";
    for (name, content, expected) in [
        (
            "a.ptx",
            format!("{ptx}1.000 2.000 3.000 0.5\n"),
            "a.ptx is cut off: it holds 1 of 2 points of scan 1",
        ),
        (
            "a.ptx",
            format!("{ptx}1 2 3 0.5\n7\n"),
            "a.ptx, line 12: a single number where a point is expected: the scan holds fewer points than its header \
             claims; export it again",
        ),
        (
            "a.ptx",
            format!("{ptx}1 2 3 0.5\n1 2 3 0.5\n1 2 3 0.5\n"),
            "a.ptx, line 13: not the number of columns that begins a scan of a PTX file: the scan before holds more \
             points than its header claims, or this is no PTX file; export it again",
        ),
        (
            "a.ptx",
            format!("{ptx}1 2 3 0.5\n1 2 3 0.5 1 2 3\n"),
            "a.ptx, line 12: 7 columns, but the points of this scan have 4",
        ),
        (
            "a.ptx",
            format!("{ptx}1 2 x 0.5\n1 2 3 0.5\n"),
            "a.ptx, line 11: \"x\" in column 3 is not a number",
        ),
        (
            "a.ptx",
            ptx.replace("1 0 0 0\n", "1 0 0 5\n"),
            "a.ptx, line 7: the fourth number of this row of the transformation must be 0: the translation stands in \
             the fourth row, not in the fourth column",
        ),
        (
            "a.ptx",
            ptx.replace("0 0 1 0\n", "0 0 0 0\n"),
            "a.ptx, line 10: the transformation of the scan has no inverse: export it again",
        ),
        (
            "a.ptx",
            ptx.replace("0 0 1 0\n", "0 nan 1 0\n"),
            "a.ptx, line 9: expected 4 numbers: a row of the transformation",
        ),
        (
            "a.pts",
            "3\n1 2 3 4\n5 6 7 8\n".to_owned(),
            "a.pts is cut off: line 1 claims 3 points, and 2 follow: export the file again",
        ),
        (
            "a.pts",
            "1\n1 2 3 4\n5 6 7 8\n1\n1 2 3 4\n".to_owned(),
            "a.pts, line 4: line 1 claims 1 points, and 2 follow: export the file again",
        ),
    ] {
        assert_eq!(failure(f, name, &content), expected);
    }
    assert!(failure(f, "a.doc", "1 2 3\n").starts_with("a.doc: unknown point cloud format"));
    for (name, content) in [
        ("a.pcd", "VERSION .7\n"),
        ("a.txt", "# .PCD v0.7 - Point Cloud Data file format\n"),
        ("a.RCP", "x"),
    ] {
        let expected = format!("{name}: this format is not read: export the cloud as E57, LAZ or PLY");
        assert_eq!(failure(f, name, content), expected);
    }
    assert!(
        read(&f.join("none.las"))
            .unwrap_err()
            .to_string()
            .contains("none.las: cannot read it")
    );
}

#[test]
fn points_without_a_position_are_counted_and_keep_their_index() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.xyz");
    fs::write(&path, "nan 0 0\n1 2 3\n1 inf 3\n4 5 6\n").unwrap();
    let mut indices: Vec<u64> = Vec::new();
    let summary = read_cloud(&path, 10, |chunk| {
        indices.extend(&chunk.indices);
        Ok::<(), CloudError>(())
    })
    .unwrap();
    assert_eq!(indices, [1, 3]);
    assert_eq!((summary.records, summary.skipped), (4, 2));
    let empty = folder.path().join("empty.xyz");
    fs::write(&empty, "# nothing\n").unwrap();
    assert_eq!(cloud_info(&empty).unwrap().bounds, None);
}

#[test]
fn a_failed_copy_leaves_the_earlier_file_and_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.laz");
    fs::write(&out, "earlier").unwrap();
    let wrong_count = |_: &_| Ok::<_, CloudError>(vec![PointLabel::default()]);
    let error = write_labelled(
        &fixture("las12_format3.las"),
        &out,
        LabelColumns::Stone,
        wrong_count,
    );
    assert!(error.unwrap_err().to_string().contains("1 labels for 120 points"));

    let cut = folder.path().join("cut.laz");
    let whole = fs::read(fixture("las14_format7_extra.laz")).unwrap();
    fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
    let error = write_labelled(&cut, &out, LabelColumns::Stone, no_labels).unwrap_err();
    assert!(error.to_string().contains("cut.laz is cut off"), "{error}");
    // A file where the folder should be.
    let missing = cut.join("out.laz");
    let error = write_labelled(&fixture("plain.xyz"), &missing, LabelColumns::Stone, no_labels);
    assert!(
        error
            .unwrap_err()
            .to_string()
            .contains("out.laz: cannot write it")
    );

    assert_eq!(fs::read_to_string(&out).unwrap(), "earlier");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[test]
fn points_without_room_for_labels_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let [long, copy] = ["long.las", "copy.laz"].map(|name| folder.path().join(name));
    let mut bytes = std::fs::read(fixture("las10_format1.las")).unwrap();
    // The length of a point, and the number of points (LAS 1.0, public header block).
    bytes[105..107].copy_from_slice(&u16::MAX.to_le_bytes());
    bytes[107..111].copy_from_slice(&0u32.to_le_bytes());
    std::fs::write(&long, bytes).unwrap();
    let message = write_labelled(&long, &copy, LabelColumns::Stone, no_labels)
        .unwrap_err()
        .to_string();
    assert!(message.contains("its points take 65535 bytes"), "{message}");
    assert!(message.contains("long.las"), "{message}");
    assert!(!copy.exists());
}

#[test]
fn points_that_cannot_be_written_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.laz");
    let points = [Point3::origin(), Point3::new(1.0, f64::NAN, 0.0)];
    let error = write_points_laz(&path, None, &points, &[]).unwrap_err();
    assert!(error.to_string().ends_with("point 1 has no position"), "{error}");
    let long = "a text that is longer than 32 bytes";
    for dimension in [
        Dimension::new(long, "m", "distance"),
        Dimension::new("d", "m", long),
        Dimension::new("d", "m", "a text of 30 bytes with its unit"),
        Dimension::new("d", "", ""),
        Dimension::new("d", "µm", "distance"),
    ] {
        let error = write_points_laz(
            &path,
            None,
            &points[..1],
            &[(dimension, ExtraColumn::F32(&[0.0]))],
        );
        let message = error.unwrap_err().to_string();
        assert!(message.contains("not a name or a description"), "{message}");
    }
    let distance = Dimension::new("d", "m", "distance");
    let error = write_points_laz(&path, None, &points[..1], &[(distance, ExtraColumn::U32(&[]))]);
    assert!(
        error
            .unwrap_err()
            .to_string()
            .contains("0 values of \"d\" for 1 points")
    );
    assert!(!path.exists());
}

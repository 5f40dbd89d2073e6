//! Tables of text as people and other programs write them.

use crate::text::decode;
use csv::{ReaderBuilder, StringRecord, Trim};
use std::path::{Path, PathBuf};

/// Separators of cells, in the order in which they win where a head holds as many of one as of another.
const SEPARATORS: [u8; 3] = [b';', b'\t', b','];

/// What a table cannot hold, and where.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}: {}", .path.display(), self.said())]
pub struct CsvError {
    /// The file.
    pub path: PathBuf,
    /// Line, counted from 1.
    pub line: usize,
    /// Name of the column, where one cell is wrong.
    pub column: Option<String>,
    /// What is wrong, and the fix.
    pub message: String,
}

impl CsvError {
    /// All but the file.
    pub fn said(&self) -> String {
        let column = self
            .column
            .as_ref()
            .map_or(String::new(), |name| format!(", column {name}"));
        format!("line {}{column}: {}", self.line, self.message)
    }
}

/// A CSV file: a line that names the columns, then a line for each row.
///
/// Cells are separated by commas, semicolons or tabs, whichever the first line holds most of; quoted as in RFC 4180;
/// spaces around them do not count. A byte order mark, lines without a cell and empty cells beyond the last column are
/// passed over.
///
/// ```
/// use std::path::Path;
/// use stonewise_io::table::CsvFile;
/// let text = "\u{feff}Name;level_m;\r\n\"Pegel; oben\";312,5;\r\n";
/// let file = CsvFile::parse(Path::new("levels.csv"), text)?;
/// let row = file.rows().next().ok_or("no row")??;
/// assert_eq!((row.text(0), row.number(1)?), ("Pegel; oben", Some(312.5)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct CsvFile {
    path: PathBuf,
    text: String,
    separator: u8,
    head: Vec<String>,
}

/// A row of a [`CsvFile`], with a cell for each column.
#[derive(Clone, Debug)]
pub struct CsvRow<'a> {
    file: &'a CsvFile,
    cells: StringRecord,
}

impl CsvFile {
    /// The table that a file holds; `path` is what errors name.
    ///
    /// # Errors
    /// The bytes are not in UTF-8, two columns have one name, or a quote is never closed.
    pub fn parse(path: &Path, bytes: impl AsRef<[u8]>) -> Result<Self, CsvError> {
        let mut file = Self {
            path: path.to_path_buf(),
            text: String::new(),
            separator: b',',
            head: Vec::new(),
        };
        file.text = decode(bytes.as_ref()).map_err(|e| file.error(e.line, e.problem()))?;
        let first = file.text.lines().find(|line| !line.trim().is_empty());
        file.separator = separator(first.unwrap_or_default());
        let names = file.records().next();
        let mut head: Vec<String> = match names.transpose()? {
            Some(row) => row.cells.iter().map(str::to_owned).collect(),
            None => Vec::new(),
        };
        while head.last().is_some_and(String::is_empty) {
            head.pop();
        }
        if let Some(twin) = (1..head.len()).find(|&i| head[..i].contains(&head[i])) {
            let message = format!("two columns are named {:?}: rename one", head[twin]);
            return Err(file.error(1, message));
        }
        file.head = head;
        Ok(file)
    }

    /// Names of the columns.
    pub fn head(&self) -> &[String] {
        &self.head
    }

    /// The place of a column.
    pub fn column(&self, name: &str) -> Option<usize> {
        self.head.iter().position(|column| column == name)
    }

    /// The rows, read one at a time.
    ///
    /// # Errors
    /// A row has another number of cells than there are columns, or a quote that is never closed.
    pub fn rows(&self) -> impl Iterator<Item = Result<CsvRow<'_>, CsvError>> {
        let rows = self.records().skip(1);
        let is_filled = |row: &CsvRow<'_>| row.cells.iter().any(|cell| !cell.is_empty());
        rows.filter(move |row| row.as_ref().map_or(true, is_filled))
            .map(|row| {
                let row = row?;
                row.check_count()?;
                Ok(row)
            })
    }

    /// An error in a line.
    pub fn error(&self, line: usize, message: impl Into<String>) -> CsvError {
        CsvError {
            path: self.path.clone(),
            line,
            column: None,
            message: message.into(),
        }
    }

    /// All lines, the head among them.
    fn records(&self) -> impl Iterator<Item = Result<CsvRow<'_>, CsvError>> {
        let mut reader = ReaderBuilder::new()
            .delimiter(self.separator)
            .has_headers(false)
            .flexible(true)
            .trim(Trim::All)
            .from_reader(self.text.as_bytes());
        std::iter::from_fn(move || {
            let mut cells = StringRecord::new();
            match reader.read_record(&mut cells) {
                Ok(false) => None,
                Ok(true) => {
                    let row = CsvRow { file: self, cells };
                    // What is never closed holds the rest of the file.
                    let is_last = reader.position().byte() == self.text.len() as u64;
                    let is_open = is_last && self.text[row.start()..].matches('"').count() % 2 == 1;
                    let message = "a quote is opened and never closed: close it, or write it twice";
                    Some(if is_open { Err(row.error(message)) } else { Ok(row) })
                }
                Err(e) => Some(Err(self.error(1, e.to_string()))),
            }
        })
    }
}

impl<'a> CsvRow<'a> {
    /// A cell without the spaces around it.
    pub fn text(&self, column: usize) -> &str {
        self.cells.get(column).unwrap_or_default()
    }

    /// A number; `None` for an empty cell and for "NaN". Where cells are not separated by commas, a comma may stand for
    /// the decimal point.
    ///
    /// # Errors
    /// The cell holds something else.
    pub fn number(&self, column: usize) -> Result<Option<f64>, CsvError> {
        let cell = self.text(column);
        if cell.is_empty() {
            return Ok(None);
        }
        let number = match self.file.separator {
            b',' => cell.parse(),
            _ => cell.replace(',', ".").parse(),
        };
        match number.ok().filter(|v: &f64| !v.is_infinite()) {
            Some(value) => Ok(Some(value).filter(|v| !v.is_nan())),
            None => {
                let message = format!("{cell:?} is no number: leave the cell empty where there is none");
                Err(self.error_in(column, message))
            }
        }
    }

    /// Its line in the file, counted from 1; takes a look at all lines before it.
    pub fn line(&self) -> usize {
        1 + self.file.text[..self.start()].matches('\n').count()
    }

    /// An error in this row.
    pub fn error(&self, message: impl Into<String>) -> CsvError {
        self.file.error(self.line(), message)
    }

    /// An error in a cell of this row.
    pub fn error_in(&self, column: usize, message: impl Into<String>) -> CsvError {
        CsvError {
            column: self.file.head.get(column).cloned(),
            ..self.error(message)
        }
    }

    /// Byte of its first character.
    fn start(&self) -> usize {
        let text = &self.file.text;
        let end = self
            .cells
            .position()
            .map_or(0, |p| p.byte() as usize)
            .min(text.len());
        // The reader counts from the end of the line before, and passes over lines without a character.
        end + text[end..]
            .bytes()
            .take_while(|b| matches!(b, b'\r' | b'\n'))
            .count()
    }

    fn check_count(&self) -> Result<(), CsvError> {
        let columns = self.file.head.len();
        let has_more = self.cells.iter().skip(columns).any(|cell| !cell.is_empty());
        if self.cells.len() >= columns && !has_more {
            return Ok(());
        }
        let fix = match self.file.separator {
            b',' => "write decimals with a point, put text with commas into quotes",
            _ => "put text with separators into quotes",
        };
        let message = format!(
            "{} cells, but the first line names {columns} columns: {fix}, and leave a cell empty where there is no value",
            self.cells.len(),
        );
        Err(self.error(message))
    }
}

/// What separates the cells of a line.
fn separator(line: &str) -> u8 {
    let mut is_quoted = false;
    let mut counts = [0_usize; SEPARATORS.len()];
    for byte in line.bytes() {
        is_quoted ^= byte == b'"';
        if let Some(i) = SEPARATORS.iter().position(|s| *s == byte && !is_quoted) {
            counts[i] += 1;
        }
    }
    let most = counts.iter().max().copied().unwrap_or_default();
    let first = counts.iter().position(|count| *count == most && most > 0);
    first.map_or(b',', |i| SEPARATORS[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Head and cells.
    fn cells(text: &str) -> Result<Vec<Vec<String>>, CsvError> {
        let file = CsvFile::parse(Path::new("a.csv"), text)?;
        let mut all = vec![file.head().to_vec()];
        for row in file.rows() {
            let row = row?;
            all.push((0..file.head().len()).map(|i| row.text(i).to_owned()).collect());
        }
        Ok(all)
    }

    #[test]
    fn every_way_to_write_a_table_gives_the_same_cells() {
        let expected = [
            ["name", "level_m", "note"],
            ["T1", "312.5", "a, b; \"c\"\td"],
            ["T2", "", "e"],
        ];
        // As Python 3.13's csv.writer has it with each separator, and with QUOTE_ALL; then by hand.
        for text in [
            "name,level_m,note\r\nT1,312.5,\"a, b; \"\"c\"\"\td\"\r\nT2,,e\r\n",
            "name;level_m;note\r\nT1;312.5;\"a, b; \"\"c\"\"\td\"\r\nT2;;e\r\n",
            "name\tlevel_m\tnote\r\nT1\t312.5\t\"a, b; \"\"c\"\"\td\"\r\nT2\t\te\r\n",
            "\"name\",\"level_m\",\"note\"\r\n\"T1\",\"312.5\",\"a, b; \"\"c\"\"\td\"\r\n\"T2\",\"\",\"e\"\r\n",
            "\u{feff}name;level_m;note;;\n\nT1 ; 312.5;\"a, b; \"\"c\"\"\td\";;\n;;;;\n   \nT2;;e;;",
        ] {
            assert_eq!(cells(text).unwrap(), expected, "{text}");
        }
        // Lines within a cell; no line at all; one column.
        assert_eq!(cells("a,b\n\"x\ny\",1\n").unwrap()[1], ["x\ny", "1"]);
        assert_eq!(cells("").unwrap(), [Vec::<String>::new()]);
        assert_eq!(cells("a\n1\n").unwrap(), [["a"], ["1"]]);
    }

    #[test]
    fn numbers_have_a_comma_where_it_separates_nothing() {
        let numbers = |text: &str| -> Vec<Option<f64>> {
            let file = CsvFile::parse(Path::new("a.csv"), text).unwrap();
            let row = file.rows().next().unwrap().unwrap();
            (0..file.head().len()).map(|i| row.number(i).unwrap()).collect()
        };
        let expected = [Some(-0.25), Some(1e-3), Some(4.0), None, None];
        assert_eq!(numbers("a,b,c,d,e\n-0.25,1e-3,4,,nan\n"), expected);
        assert_eq!(numbers("a;b;c;d;e\n-0,25;1e-3;4;;NaN\n"), expected);
        assert_eq!(numbers("a\tb\tc\td\te\n-0,25\t0,001\t4,0\t\t\n"), expected);
    }

    #[test]
    fn mistakes_are_named_with_file_line_and_column() {
        let wrong = |text: &str| {
            let number = || {
                let file = CsvFile::parse(Path::new("levels.csv"), text)?;
                for row in file.rows() {
                    let row = row?;
                    (0..file.head().len()).try_for_each(|i| row.number(i).map(drop))?;
                }
                Ok::<(), CsvError>(())
            };
            number().unwrap_err().to_string()
        };
        for (text, message) in [
            ("a,b\n1,2\n\n\n3,x\n", "line 5, column b: \"x\" is no number"),
            (
                "a,b\r\n1,2\r\n\r\n3,x\r\n",
                "line 4, column b: \"x\" is no number",
            ),
            ("a;b\n1.234,5;1\n", "line 2, column a: \"1.234,5\" is no number"),
            ("a,b\n1,inf\n", "line 2, column b: \"inf\" is no number"),
            (
                "a,b\n\"1\n\",2\n1,2,3\n",
                "line 4: 3 cells, but the first line names 2 columns",
            ),
            ("a,b\n1\n", "line 2: 1 cells, but the first line names 2 columns"),
            ("a,b,a\n", "line 1: two columns are named \"a\""),
            (
                "a,b\n1,2\n3,\"4\n5,6\n",
                "line 3: a quote is opened and never closed",
            ),
        ] {
            let found = wrong(text);
            assert!(found.starts_with(&format!("levels.csv: {message}")), "{found}");
        }
        let latin = CsvFile::parse(Path::new("levels.csv"), *b"a;b\n1;2\nH\xf6he;3\n").unwrap_err();
        assert!(
            latin.line == 3 && latin.message.contains("save the file as UTF-8"),
            "{latin}"
        );
    }

    #[test]
    fn text_that_is_no_table_does_no_harm() {
        let alphabet = [
            "\"", ",", ";", "\t", "\r", "\n", "a", "1", " ", "\u{feff}", "\u{e4}",
        ];
        let mut state = 1_u64;
        for _ in 0..20_000 {
            let text: String = (0..24)
                .map(|_| {
                    // The multiplier of Knuth's MMIX.
                    state = state
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1_442_695_040_888_963_407);
                    alphabet[(state >> 33) as usize % alphabet.len()]
                })
                .collect();
            let _ = cells(&text);
        }
    }
}

//! Which source files of a crate use which.
//!
//! A use is a path through `crate`, `super`, `self` or a child module, outside comments and outside the tests at the
//! end of a file. It points at the file that owns the item: re-exports are followed. A module inside a file counts
//! as the file, so `super` must not be used in one outside tests.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Names of the modules from the crate's root to a file.
type Module = Vec<String>;

/// A path to an item, and the name that the item has in the file.
struct Import {
    path: Module,
    name: String,
}

/// Fails unless every top-level module of a crate is listed and uses only modules of lines above its own, and no files
/// use each other in a circle.
///
/// `folder`: the crate's. `layers`: the modules from the bottom up; those on one line do not use each
/// other.
pub fn assert_layers(folder: &Path, layers: &[&[&str]]) {
    let graph = ModuleGraph::read(&folder.join("src"));
    let uses: usize = graph.uses.values().map(Vec::len).sum();
    assert!(
        uses >= graph.uses.len(),
        "only {uses} uses found: the search is broken"
    );
    graph.assert_layers(layers);
    graph.assert_no_circle();
}

/// The source files of a crate, and the files that each uses.
struct ModuleGraph {
    uses: BTreeMap<Module, Vec<Module>>,
}

impl ModuleGraph {
    /// Reads all source files below a crate's `src`.
    fn read(src: &Path) -> Self {
        let mut texts = BTreeMap::new();
        collect(src, &[], &mut texts);
        let paths: BTreeMap<Module, Vec<Import>> = texts
            .iter()
            .map(|(module, text)| (module.clone(), paths(text, &children(module, &texts))))
            .collect();
        let uses = paths.iter().map(|(module, list)| {
            let used = list
                .iter()
                .filter_map(|import| owner(module, &import.path, &paths));
            let mut used: Vec<Module> = used.filter(|used| used != module).collect();
            used.sort();
            used.dedup();
            (module.clone(), used)
        });
        Self { uses: uses.collect() }
    }

    /// Fails where a top-level module is not listed, or uses one that is neither itself nor listed before its
    /// line. Modules on one line do not see each other.
    fn assert_layers(&self, layers: &[&[&str]]) {
        let level = |module: &str| layers.iter().position(|line| line.contains(&module));
        for listed in layers.iter().flat_map(|line| line.iter()) {
            let exists = self
                .uses
                .keys()
                .any(|m| m.first().is_some_and(|top| top == listed));
            assert!(exists, "the list of layers names {listed}, which does not exist");
        }
        for (module, used) in &self.uses {
            let Some(top) = module.first() else { continue };
            let own = level(top);
            assert!(own.is_some(), "module {top} is missing in the list of layers");
            for other in used.iter().filter_map(|path| path.first()) {
                assert!(
                    other == top || level(other) < own,
                    "{} uses {other}, which is not below {top}",
                    module.join("::")
                );
            }
        }
    }

    /// Fails where files use each other in a circle, and names one.
    fn assert_no_circle(&self) {
        let mut done = Vec::new();
        for module in self.uses.keys() {
            if let Some(circle) = self.circle(module, &mut Vec::new(), &mut done) {
                let names: Vec<String> = circle.iter().map(|path| path.join("::")).collect();
                panic!("files use each other in a circle: {}", names.join(" -> "));
            }
        }
    }

    fn circle(&self, module: &Module, open: &mut Vec<Module>, done: &mut Vec<Module>) -> Option<Vec<Module>> {
        if let Some(from) = open.iter().position(|m| m == module) {
            return Some([&open[from..], std::slice::from_ref(module)].concat());
        }
        if done.contains(module) {
            return None;
        }
        open.push(module.clone());
        let found = self.uses[module]
            .iter()
            .find_map(|used| self.circle(used, open, done));
        open.pop();
        done.push(module.clone());
        found
    }
}

/// Texts of the files below a folder by module path, without comments and tests.
fn collect(folder: &Path, module: &[String], texts: &mut BTreeMap<Module, String>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let inner = [module, std::slice::from_ref(&name)].concat();
        if path.is_dir() {
            collect(&path, &inner, texts);
        } else if path.extension().is_some_and(|e| e == "rs") {
            let is_root = name == "mod" || name == "lib" || name == "main";
            let at = if is_root { module.to_vec() } else { inner };
            let text = fs::read_to_string(&path).unwrap();
            texts.insert(at, code(&text));
        }
    }
}

/// Names of the modules directly below a module that are files.
fn children(module: &Module, texts: &BTreeMap<Module, String>) -> Vec<String> {
    let below = texts
        .keys()
        .filter(|m| m.len() == module.len() + 1 && m.starts_with(module));
    below.filter_map(|m| m.last().cloned()).collect()
}

/// A file's text without comments and tests; names that are keywords lose their `r#`.
fn code(text: &str) -> String {
    let end = text.find("\nmod tests {").unwrap_or(text.len());
    let without_comment = |line: &str| line.split("//").next().unwrap_or("").to_owned();
    text[..end]
        .lines()
        .map(without_comment)
        .collect::<Vec<_>>()
        .join("\n")
        .replace("r#", "")
}

/// All paths in a file that begin with `crate`, `super`, `self` or a child module, and all imports; trees are
/// expanded.
fn paths(code: &str, children: &[String]) -> Vec<Import> {
    let mut found = Vec::new();
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    let starts = ["crate", "super", "self"].into_iter();
    for start in starts.chain(children.iter().map(String::as_str)) {
        for (at, _) in code.match_indices(&format!("{start}::")) {
            let before = &code[..at];
            // The path of `pub(in path)` says who may see an item.
            if !before.ends_with("::") && !before.ends_with(is_name) && !before.ends_with("(in ") {
                tree(&code[at..], &[], &mut found);
            }
        }
    }
    for (at, _) in code.match_indices("use ") {
        let starts_line = code[..at].rsplit('\n').next().is_some_and(|line| {
            let line = line.trim();
            line.is_empty() || line.starts_with("pub")
        });
        if starts_line {
            tree(&code[at + 4..], &[], &mut found);
        }
    }
    found
}

/// Expands `a::{b, c::D}` into its paths; returns the length of the tree.
fn tree(text: &str, before: &[String], found: &mut Vec<Import>) -> usize {
    let mut path = before.to_vec();
    let mut at = 0;
    loop {
        let rest = &text[at..];
        let skipped = rest.len() - rest.trim_start().len();
        let rest = rest.trim_start();
        at += skipped;
        if rest.starts_with('{') {
            at += 1;
            while at < text.len() && !text[at..].trim_start().starts_with('}') {
                at += tree(&text[at..], &path, found);
                let rest = &text[at..];
                let comma = rest
                    .find(|c: char| !c.is_whitespace() && c != ',')
                    .unwrap_or(rest.len());
                at += comma;
                if comma == 0 && !text[at..].starts_with('}') {
                    return at;
                }
            }
            at += text[at..].find('}').map_or(0, |k| k + 1);
            return at;
        }
        let end = rest
            .find(|c: char| !(c.is_alphanumeric() || c == '_'))
            .unwrap_or(rest.len());
        path.push(rest[..end].to_owned());
        at += end;
        if text[at..].starts_with("::") {
            at += 2;
            continue;
        }
        let mut name = rest[..end].to_owned();
        if let Some(alias) = text[at..].trim_start().strip_prefix("as ") {
            let length = alias.find([',', ';', '}']).unwrap_or(alias.len());
            name = alias[..length].trim().to_owned();
            at = text.len() - alias.len() + length;
        }
        found.push(Import { path, name });
        return at;
    }
}

/// The module that owns what a path in `module` leads to; `None` for other crates. `paths`: of all modules.
fn owner(module: &Module, path: &[String], paths: &BTreeMap<Module, Vec<Import>>) -> Option<Module> {
    let mut at = match path.first()?.as_str() {
        "crate" => Vec::new(),
        "super" | "self" => module.clone(),
        child => {
            let inner = [module.as_slice(), &[child.to_owned()]].concat();
            paths.contains_key(&inner).then(|| module.clone())?
        }
    };
    for segment in path {
        match segment.as_str() {
            "crate" | "self" => {}
            "super" => drop(at.pop()),
            name => {
                let inner = [at.as_slice(), &[name.to_owned()]].concat();
                if !paths.contains_key(&inner) {
                    let exported = paths[&at].iter().find(|import| import.name == name);
                    let follows = at != *module && exported.is_some_and(|import| import.path != path);
                    let Some(import) = exported.filter(|_| follows) else {
                        return Some(at);
                    };
                    let owned = owner(&at, &import.path, paths);
                    // What the root passes on from another crate belongs to no file of this one.
                    return if at.is_empty() { owned } else { owned.or(Some(at)) };
                }
                at = inner;
            }
        }
    }
    Some(at)
}

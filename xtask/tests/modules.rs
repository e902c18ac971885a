//! The modules of every crate, as their sources say what they import from each other.
#![allow(
    clippy::unwrap_used,
    reason = "a source that cannot be read fails the test"
)]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use syn::visit::{self, Visit};
use syn::{Attribute, Item, ItemUse, UseName, UseRename, UseTree};

/// A module's path below its crate's root; the root's is empty.
type Module = Vec<String>;

/// What each module imports from others of its crate: `use` and paths that begin with `crate`, `self` or `super`.
type Imports = BTreeMap<Module, BTreeSet<Module>>;

#[test]
fn no_modules_of_a_crate_import_each_other_in_a_circle() {
    let mut circles = Vec::new();
    let sources = sources();
    assert!(
        sources.len() > 20,
        "the crates are elsewhere: only {sources:?}"
    );
    for source in sources {
        for (module, imported) in on_circles(imports(&read(&source))) {
            let imported: Vec<String> = imported.iter().map(|m| m.join("::")).collect();
            circles.push(format!(
                "{}: {} imports from {}",
                source.display(),
                module.join("::"),
                imported.join(", ")
            ));
        }
    }
    assert!(
        circles.is_empty(),
        "what two modules share lies below both:\n{}",
        circles.join("\n")
    );
}

#[test]
fn a_circle_is_found_through_braces_paths_and_inner_modules() {
    let files = |texts: &[(&str, &str)]| -> Vec<(Module, syn::File)> {
        texts
            .iter()
            .map(|(module, text)| {
                (
                    module.split("::").map(str::to_owned).collect(),
                    syntax(text),
                )
            })
            .collect()
    };
    let found = |texts| on_circles(imports(&files(texts))).len();
    // a -> b::c -> a; d only looks on.
    let circle = [
        ("a", "use crate::b::{self, c::{Depth, Width}};"),
        ("b", ""),
        ("b::c", "fn f() -> super::super::a::Length { todo!() }"),
        ("d", "use crate::a::Length;"),
    ];
    assert_eq!(found(&circle), 2);
    let inner = [
        ("a", "mod inner { use super::super::b::X; }"),
        ("b", "use crate::a::Y;"),
    ];
    assert_eq!(found(&inner), 2);
    let in_tests = [
        ("a", "#[cfg(test)] mod tests { use crate::b::X; }"),
        ("b", "use crate::a::Y;"),
    ];
    assert_eq!(found(&in_tests), 0);
}

/// The `src` folder of every crate in the repository.
fn sources() -> Vec<PathBuf> {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
    let folders = ["crates", "studies", "tests", "benches"].map(|group| {
        let entries = fs::read_dir(root.join(group)).unwrap();
        entries.map(|entry| entry.unwrap().path()).collect()
    });
    let single: Vec<PathBuf> = ["firmware", "host-sim", "xtask"]
        .map(|name| root.join(name))
        .into();
    let mut all: Vec<PathBuf> = folders.into_iter().chain([single]).flatten().collect();
    all.sort();
    all.into_iter()
        .map(|folder| folder.join("src"))
        .filter(|source| source.is_dir())
        .collect()
}

/// Every module that is a file, with its syntax.
fn read(source: &Path) -> Vec<(Module, syn::File)> {
    let mut modules = Vec::new();
    let mut folders = vec![(Module::new(), source.to_owned())];
    while let Some((module, folder)) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_stem().unwrap().to_string_lossy().into_owned();
            let mut below = module.clone();
            if path.is_dir() {
                below.push(name);
                folders.push((below, path));
                continue;
            }
            if path.extension().is_none_or(|extension| extension != "rs") {
                continue;
            }
            if !["mod", "lib", "main"].contains(&name.as_str()) {
                below.push(name);
            }
            modules.push((below, syntax(&fs::read_to_string(&path).unwrap())));
        }
    }
    modules
}

fn syntax(text: &str) -> syn::File {
    syn::parse_file(text).unwrap()
}

fn imports(files: &[(Module, syn::File)]) -> Imports {
    let modules: BTreeSet<&Module> = files.iter().map(|(module, _)| module).collect();
    let mut imports = Imports::new();
    for (module, file) in files {
        let mut finder = Finder {
            here: module.clone(),
            paths: Vec::new(),
        };
        finder.visit_file(file);
        let found = finder.paths.into_iter().filter_map(|mut path| {
            // An item's path begins with its module's.
            while !modules.contains(&path) {
                path.pop()?;
            }
            Some(path)
        });
        // The root names what the crate shows: every module may know it.
        imports
            .entry(module.clone())
            .or_default()
            .extend(found.filter(|other| other != module && !other.is_empty()));
    }
    imports
}

/// What is left when modules that nobody left imports, or that import nobody left, are taken away again and again.
fn on_circles(mut imports: Imports) -> Imports {
    loop {
        let importers: BTreeSet<Module> = imports
            .iter()
            .filter(|(_, imported)| !imported.is_empty())
            .map(|(module, _)| module.clone())
            .collect();
        let imported: BTreeSet<Module> = imports.values().flatten().cloned().collect();
        let before = imports.len();
        imports.retain(|module, _| importers.contains(module) && imported.contains(module));
        let left: BTreeSet<Module> = imports.keys().cloned().collect();
        for imported in imports.values_mut() {
            imported.retain(|module| left.contains(module));
        }
        if imports.len() == before {
            return imports;
        }
    }
}

/// Gathers paths that begin with `crate`, `self` or `super`, from the crate's root.
struct Finder {
    /// The module that is looked at: a file's, or one inside it.
    here: Module,
    paths: Vec<Vec<String>>,
}

impl Finder {
    fn add(&mut self, path: &[String]) {
        let supers = path.iter().take_while(|part| *part == "super").count();
        let above = self.here.len().saturating_sub(supers);
        let (from, rest) = match path.first().map(String::as_str) {
            Some("crate") => (&[][..], &path[1..]),
            Some("self") => (&self.here[..], &path[1..]),
            Some("super") => (&self.here[..above], &path[supers..]),
            _ => return,
        };
        self.paths.push([from, rest].concat());
    }

    fn add_tree(&mut self, above: &mut Vec<String>, tree: &UseTree) {
        match tree {
            UseTree::Path(path) => {
                above.push(path.ident.to_string());
                self.add_tree(above, &path.tree);
                above.pop();
            }
            UseTree::Group(group) => {
                for tree in &group.items {
                    self.add_tree(above, tree);
                }
            }
            UseTree::Name(name) if name.ident == "self" => self.add(above),
            UseTree::Name(UseName { ident }) | UseTree::Rename(UseRename { ident, .. }) => {
                above.push(ident.to_string());
                self.add(above);
                above.pop();
            }
            UseTree::Glob(_) => self.add(above),
        }
    }
}

impl<'ast> Visit<'ast> for Finder {
    fn visit_item(&mut self, item: &'ast Item) {
        let attributes: &[Attribute] = match item {
            Item::Mod(item) => &item.attrs,
            Item::Fn(item) => &item.attrs,
            Item::Use(item) => &item.attrs,
            Item::Impl(item) => &item.attrs,
            _ => &[],
        };
        if attributes.iter().any(for_tests) {
            return;
        }
        if let Item::Mod(inner) = item {
            self.here.push(inner.ident.to_string());
            visit::visit_item(self, item);
            self.here.pop();
        } else {
            visit::visit_item(self, item);
        }
    }

    /// What may see an item is not what it imports.
    fn visit_visibility(&mut self, _: &'ast syn::Visibility) {}

    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        self.add_tree(&mut Vec::new(), &item.tree);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let parts: Vec<String> = path.segments.iter().map(|s| s.ident.to_string()).collect();
        self.add(&parts);
        visit::visit_path(self, path);
    }
}

/// Whether an attribute is `#[cfg(test)]`.
fn for_tests(attribute: &Attribute) -> bool {
    attribute.path().is_ident("cfg")
        && attribute
            .parse_args::<syn::Path>()
            .is_ok_and(|path| path.is_ident("test"))
}

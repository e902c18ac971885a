//! Rigs, maps and models, from files or from text.

use std::path::{Path, PathBuf};

use muslip_formats::map::Map;
use muslip_recordings::input_error::{InputError, InputProblem};
use muslip_recordings::map_file;
use muslip_recordings::model_file::ModelFile;
use muslip_recordings::output::write_file;
use muslip_recordings::rig_file::{LARGEST_RADIUS_M, RigFile, SMALLEST_RADIUS_M};
use pyo3::prelude::*;

use crate::failure::Failure;
use crate::job::guarded;

/// What stands for a file's name where there is none.
const NO_FILE: &str = "rig";

/// A rig, read and checked.
#[pyclass(frozen, module = "muslip._native")]
pub(crate) struct Rig {
    path: PathBuf,
    text: String,
    pub(crate) file: RigFile,
    /// The map of channels in it, where it has one.
    pub(crate) map: Option<Map>,
    /// False where only the radius is known.
    whole: bool,
}

#[pymethods]
impl Rig {
    /// Of a file.
    #[staticmethod]
    fn read(path: PathBuf) -> PyResult<Self> {
        Ok(guarded(|| {
            let text =
                std::fs::read(&path).map_err(|error| InputError::unreadable(&path, &error))?;
            Self::parsed(&path, &text)
        })?)
    }

    /// Of a rig file's text; `path` stands for the file in errors.
    #[staticmethod]
    #[pyo3(signature = (text, path=None))]
    fn of_text(text: &str, path: Option<PathBuf>) -> PyResult<Self> {
        let path = path.unwrap_or_else(|| NO_FILE.into());
        Ok(guarded(|| Self::parsed(&path, text.as_bytes()))?)
    }

    /// Of the rig file's tables as JSON.
    #[staticmethod]
    fn of_json(json: &str) -> PyResult<Self> {
        Ok(guarded(|| {
            let fail = |what: String| {
                Failure::Input(InputError::whole_file(
                    Path::new(NO_FILE),
                    InputProblem::Toml(what),
                ))
            };
            let tables: serde_json::Value =
                serde_json::from_str(json).map_err(|error| fail(error.to_string()))?;
            let text = toml::to_string(&tables).map_err(|error| fail(error.to_string()))?;
            Self::parsed(Path::new(NO_FILE), text.as_bytes())
        })?)
    }

    /// Of the wheel's radius alone, in m.
    #[staticmethod]
    fn of_radius(radius_m: f64) -> PyResult<Self> {
        if !(SMALLEST_RADIUS_M..=LARGEST_RADIUS_M).contains(&radius_m) {
            return Err(Failure::Other(format!(
                "radius_m = {radius_m}: must be between {SMALLEST_RADIUS_M} and {LARGEST_RADIUS_M} m"
            ))
            .into());
        }
        Ok(Self {
            path: NO_FILE.into(),
            text: format!("[wheel]\nradius_m = {radius_m:?}\n"),
            file: RigFile::of_radius(radius_m),
            map: None,
            whole: false,
        })
    }

    #[getter]
    fn path(&self) -> String {
        self.path.display().to_string()
    }

    #[getter]
    fn text(&self) -> &str {
        &self.text
    }

    #[getter]
    fn whole(&self) -> bool {
        self.whole
    }

    /// The tables as JSON.
    fn json(&self) -> PyResult<String> {
        let fail = |error: &dyn std::error::Error| Failure::Other(error.to_string());
        let tables: toml::Table = toml::from_str(&self.text).map_err(|error| fail(&error))?;
        Ok(serde_json::to_string(&tables).map_err(|error| fail(&error))?)
    }
}

impl Rig {
    fn parsed(path: &Path, bytes: &[u8]) -> Result<Self, Failure> {
        let file = RigFile::parse(path, bytes)?;
        let map = map_file::in_use(map_file::parse(path, bytes)?);
        Ok(Self {
            path: path.to_owned(),
            text: String::from_utf8_lossy(bytes).into_owned(),
            file,
            map,
            whole: true,
        })
    }

    /// The rig file as a work needs it that asks for more than the radius.
    pub(crate) fn whole_file(&self) -> Result<RigFile, Failure> {
        if self.whole {
            return Ok(self.file.clone());
        }
        Err(Failure::Other(
            "only the radius of the rig is known: inertia_kg_m2, mass_kg, peak_friction and critical_slip are needed as well".to_owned(),
        ))
    }

    pub(crate) fn path_or_name(&self) -> &Path {
        &self.path
    }
}

/// A map: of a file where it is a path, else of the map's tables as JSON.
pub(crate) fn map_of(map: Option<&(bool, String)>) -> Result<Option<Map>, Failure> {
    match map {
        None => Ok(None),
        Some((true, path)) => Ok(Some(map_file::read(Path::new(path))?)),
        Some((false, json)) => {
            let fail =
                |what: String| InputError::whole_file(Path::new("map"), InputProblem::Toml(what));
            let map: Map = serde_json::from_str(json).map_err(|error| fail(error.to_string()))?;
            map.check().map_err(fail)?;
            Ok(Some(map))
        }
    }
}

/// The tables of a map's file as JSON, once they are checked: a map that goes where its file does not.
#[pyfunction]
pub(crate) fn map_json(path: PathBuf) -> PyResult<String> {
    Ok(guarded(|| {
        let bytes = std::fs::read(&path).map_err(|error| InputError::unreadable(&path, &error))?;
        map_file::parse(&path, &bytes)?;
        let fail = |error: &dyn std::error::Error| Failure::Other(error.to_string());
        let tables: toml::Table =
            toml::from_str(&String::from_utf8_lossy(&bytes)).map_err(|error| fail(&error))?;
        serde_json::to_string(&tables).map_err(|error| fail(&error))
    })?)
}

/// A repaired model.
#[pyclass(frozen, module = "muslip._native")]
pub(crate) struct Model {
    pub(crate) file: ModelFile,
}

#[pymethods]
impl Model {
    #[staticmethod]
    fn read(path: PathBuf) -> PyResult<Self> {
        Ok(guarded(|| {
            Ok(Self {
                file: ModelFile::read(&path)?,
            })
        })?)
    }

    #[staticmethod]
    fn of_text(text: &str) -> PyResult<Self> {
        Ok(guarded(|| {
            Ok(Self {
                file: ModelFile::parse(Path::new("model"), text.as_bytes())?,
            })
        })?)
    }

    #[getter]
    fn text(&self) -> &str {
        self.file.text()
    }

    fn save(&self, path: PathBuf) -> PyResult<()> {
        Ok(write_file(&path, self.file.text().as_bytes()).map_err(Failure::from)?)
    }
}

//! Writes a material and the figure of its fit, as a node.

use super::material::Material;
use super::reader::write_material;
use crate::core::fault::{Fault, Reject};
use crate::core::item::Data;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::OutPath;
use crate::core::ports::Value;
use crate::core::shape::{Build, Shape};
use crate::io::text_output::TextOutput;
use crate::material::estimation::report::FitReport;
use crate::{params, ports};

params! {
    /// Writes a material to a file that `MaterialFile` reads, and the figure of its fit.
    pub struct MaterialOutParams {
        /// The file, such as `porcelain.material.ron`.
        path: OutPath;
        /// SVG of the fit: points, fitted curve with interval, and the distribution of the excess.
        figure: Option<OutPath> = None;
    }
}
ports! {
    pub struct MaterialOutPorts / MaterialOutIo {
        in {
            /// The material.
            material: Value<Material>,
            /// Report of its fit, for the figure.
            report: Option<Value<FitReport>>,
        }
        out {}
    }
}

/// The node over [`write_material`].
#[derive(Debug)]
pub struct MaterialOut {
    files: Vec<(TextOutput, String)>,
}

impl Node for MaterialOut {
    type Params = MaterialOutParams;
    type Ports = MaterialOutPorts;
    const NAME: &'static str = "MaterialOut";
    const CLASS: Class = Class::Offline;

    fn shape(p: &MaterialOutParams, s: &mut Shape<'_, '_, MaterialOutPorts>) -> Result<(), Reject> {
        if p.figure.is_some() && !s.linked(MaterialOutPorts::report) {
            let reject = Reject::new("F137", "a figure needs the report of a fit").at("figure");
            s.wrong(reject.help("link `report` of the DampingFit to `report`"));
        }
        s.ends(Some(0));
        Ok(())
    }

    fn build(p: &MaterialOutParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let material = cx.value(MaterialOutPorts::material);
        let mut files = vec![(TextOutput::create(cx, "path", &p.path)?, write_material(&material, &[]))];
        if let Some(path) = &p.figure {
            let svg = cx.optional_value(MaterialOutPorts::report).and_then(|report| report.plot());
            files.push((TextOutput::create(cx, "figure", path)?, svg.unwrap_or_default()));
        }
        Ok(Self { files })
    }

    fn run(&mut self, _: MaterialOutIo<'_>) -> Result<(), Fault> {
        Ok(())
    }

    fn finish(&mut self, _: MaterialOutIo<'_>) -> Result<Summary, Fault> {
        let mut summary = Summary::new();
        self.files.iter_mut().try_for_each(|(file, text)| file.write(text, &mut summary))?;
        Ok(summary)
    }
}

//! The commands of `gridweave`, each with its arguments in a file or a folder.

pub(crate) mod cat;
pub(crate) mod check;
pub(crate) mod compare;
pub(crate) mod convert;
pub(crate) mod demo;
pub(crate) mod evaluate;
pub(crate) mod golden;
pub(crate) mod graph;
pub(crate) mod info;
pub(crate) mod kinds;
pub(crate) mod live;
mod map_file_info;
pub(crate) mod merge;
pub(crate) mod pipelines;
pub(crate) mod processes;
pub(crate) mod recover;
pub(crate) mod render;
pub(crate) mod report;
pub(crate) mod run;
pub(crate) mod shell;
pub(crate) mod simulate;

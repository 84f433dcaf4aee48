mod analytic;
mod assembly;
mod solver;

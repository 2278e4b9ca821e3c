//! Every crate that ends up in a build has a licence that allows shipping it under MIT.

use std::path::Path;

use cargo_metadata::MetadataCommand;

/// Permissive licences, and MPL-2.0, whose obligations are limited to the files it covers.
const ALLOWED: &[&str] = &[
    "0BSD",
    "Apache-2.0",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "CC0-1.0",
    "ISC",
    "MIT",
    "MIT-0",
    "MPL-2.0",
    "NCSA",
    "Unicode-3.0",
    "Unlicense",
    "Zlib",
    // The fonts bundled with egui.
    "OFL-1.1",
    "Ubuntu-font-1.0",
];

#[test]
fn every_dependency_is_permissively_licensed() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests package lies in the workspace");
    let metadata = MetadataCommand::new().current_dir(root).exec().expect("cargo metadata");
    let allowed = |requirement: &spdx::LicenseReq| {
        let name = requirement.license.to_string();
        ALLOWED.contains(&name.as_str())
    };
    let mut checked = 0;
    for package in metadata.packages.iter().filter(|p| p.source.is_some()) {
        let licence = package
            .license
            .as_deref()
            .unwrap_or_else(|| panic!("{} {} names no licence", package.name, package.version));
        let expression = spdx::Expression::parse_mode(licence, spdx::ParseMode::LAX)
            .unwrap_or_else(|e| panic!("{}: licence {licence:?}: {e}", package.name));
        assert!(expression.evaluate(allowed), "{} {} is under {licence}", package.name, package.version);
        checked += 1;
    }
    assert!(checked > 100, "only {checked} dependencies were checked");
}

//! Link arguments of the image; nothing for the host.

use std::path::Path;

/// Boards, each a feature and a folder with the `board.x` that the project's `memory.x` includes.
const BOARDS: [(&str, &str); 2] = [
    ("CARGO_FEATURE_STM32F405", "stm32f405"),
    ("CARGO_FEATURE_STM32G474", "stm32g474"),
];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=../memory.x");
    if std::env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for (feature, board) in BOARDS {
        if std::env::var_os(feature).is_some() {
            let folder = sources.join(board);
            println!(
                "cargo:rerun-if-changed={}",
                folder.join("board.x").display()
            );
            println!("cargo:rustc-link-search={}", folder.display());
        }
    }
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
}

# Short names for the commands of CONTRIBUTING.md. `just` alone lists them.

_list:
    @just --list

# Check the format, lint one package, and run the tests inside the source: before a push
check package="ballast":
    cargo fmt --all --check
    cargo clippy --locked --package {{ package }} --all-targets -- -D warnings
    cargo test --locked --lib

# Run everything in Rust, or the tests that the arguments select: `just test --test service sessions::`
test *arguments:
    cargo test --locked {{ arguments }}

# Write the description of the interface
openapi:
    cargo run --locked -- openapi > api/openapi.json

# Write the types of the Python client from the description
client: openapi
    clients/python/generate

# Take the pictures of docs/images that need nothing but the release build
pictures:
    cargo build --locked --release
    cd tests/browser && npm ci && node screenshots.js

# Write the store of the newest schema, and the service's answers over it, in tests/data/store
fixtures:
    cargo test --locked --test project upgrade:: -- --ignored

# Measure or experiment: `just lab bench training`
lab *arguments:
    cargo run --locked --release --package ballast-lab -- {{ arguments }}

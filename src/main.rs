//! Parses the command line and runs what it names.

mod command;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use command::{healthcheck, serve};

/// Nonparametric adaptive robust control of an investor, as a service.
#[derive(Debug, Parser)]
#[command(version)]
struct CommandLine {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run the service.
    Serve(serve::Serve),
    /// Exit 0 if a running service is ready, else 1.
    Healthcheck(healthcheck::Healthcheck),
    /// Print the OpenAPI description.
    Openapi,
}

#[tokio::main]
async fn main() -> ExitCode {
    let outcome = match CommandLine::parse().command {
        Command::Serve(arguments) => serve::run(arguments).await,
        Command::Healthcheck(arguments) => healthcheck::run(&arguments),
        Command::Openapi => {
            print!("{}", ballast::http::description_json());
            Ok(())
        }
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let mut causes = String::new();
            let mut source = error.source();
            while let Some(cause) = source {
                causes = format!("{causes}: {cause}");
                source = cause.source();
            }
            eprintln!("ballast: {error}{causes}");
            ExitCode::FAILURE
        }
    }
}

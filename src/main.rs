use clap::{Parser, Subcommand};

mod command;

#[derive(Parser)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Demo(command::demo::DemoArgs),
}

#[tokio::main]
async fn main() -> std::process::ExitCode {
    let Command::Demo(args) = Cli::parse().command;
    if let Err(error) = command::demo::run(args).await {
        eprintln!("ballast: {}", command::with_causes(&error));
        return std::process::ExitCode::FAILURE;
    }
    std::process::ExitCode::SUCCESS
}

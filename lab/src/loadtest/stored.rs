//! Bytes in the store per session and per observation of a service under load.

use std::error::Error;

use sqlx::postgres::PgConnection;
use sqlx::{AssertSqlSafe, Connection};

use super::figures::LoadReport;
use super::server::Server;

/// Growth of the store by sessions and by observations.
#[derive(Default)]
pub struct Growth {
    last: u64,
    sessions: u64,
    observations: u64,
}

impl Growth {
    /// Starts measuring from the current size.
    pub async fn start(&mut self, server: &Server) -> Result<(), Box<dyn Error>> {
        self.grown(server).await.map(drop)
    }

    /// Counts the growth since the last call as sessions; only sessions were opened.
    pub async fn opened(&mut self, server: &Server) -> Result<(), Box<dyn Error>> {
        self.sessions += self.grown(server).await?;
        Ok(())
    }

    /// Counts the growth since the last call as observations; only observations were made.
    pub async fn observed(&mut self, server: &Server) -> Result<(), Box<dyn Error>> {
        self.observations += self.grown(server).await?;
        Ok(())
    }

    async fn grown(&mut self, server: &Server) -> Result<u64, Box<dyn Error>> {
        let bytes = match server.store() {
            Some(store) => {
                let mut connection = PgConnection::connect(store).await?;
                let size = "SELECT pg_database_size(current_database())";
                let bytes: i64 = sqlx::query_scalar(size).fetch_one(&mut connection).await?;
                connection.close().await?;
                u64::try_from(bytes)?
            }
            None => server.database_bytes().unwrap_or_default(),
        };
        let grown = bytes.saturating_sub(self.last);
        self.last = bytes;
        Ok(grown)
    }

    /// Reports the bytes per session and per observation, if the store is known.
    pub fn tell(&self, sessions: usize, observations: usize, report: &mut LoadReport) {
        if self.last > 0 {
            let [session, observation] = [(self.sessions, sessions), (self.observations, observations)]
                .map(|(bytes, count)| bytes as f64 / count.max(1) as f64);
            report.note(format!("on the disk: {session:.0} bytes a session, {observation:.0} an observation"));
        }
    }
}

/// Runs a statement on the database at `store`.
pub async fn execute(store: &str, statement: &str) -> Result<(), sqlx::Error> {
    let mut connection = PgConnection::connect(store).await?;
    sqlx::query(AssertSqlSafe(statement.to_owned())).execute(&mut connection).await?;
    connection.close().await
}

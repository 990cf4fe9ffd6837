//! The words on what to hold and what to trade.

use crate::control::policy::advice::SpendingAdvice;
use crate::service::advice::action::AccountAdvice;
use crate::service::letter::content::{AssetLine, LetterOrder, Phrase, plain, strong};
use crate::service::letter::figures::{self, MoneyFormat, percent};
use crate::service::letter::request::SmallestTrade;
use crate::service::sessions::fund_advice::FundAdvice;

/// A trade of a smaller share of wealth counts as none, because advice is shown to a tenth of a percent.
const LITTLE: f64 = 0.0005;

/// The context of an advice: its period, wealth before it, and the terms in money.
pub(super) struct OrderContext<'a> {
    pub money: &'a MoneyFormat,
    /// The name of the period within a sentence.
    pub period: String,
    pub wealth: f64,
    pub trading_cost: f64,
    pub smallest: SmallestTrade,
}

/// An asset as it is held and is to be held, as shares of wealth and in money.
struct AssetOrder {
    name: String,
    share: f64,
    holding: f64,
    /// Share of wealth to buy, negative to sell.
    trade: f64,
    /// Money in it after trading.
    amount: f64,
    /// Money to buy, negative to sell; 0 if the trade is too small.
    traded: f64,
}

/// The orders of an advice, and the money behind them.
pub(super) struct AdviceOrders {
    assets: Vec<AssetOrder>,
    /// Wealth after spending and trading.
    all: f64,
    /// Share of wealth in all assets together.
    total: f64,
    is_several: bool,
    spending: Option<SpendingAdvice>,
    contribution: f64,
}

impl AdviceOrders {
    /// Returns the orders that follow an advice. Assets that left the session are sold.
    pub fn of(AccountAdvice { advice, assets, .. }: &AccountAdvice, context: &OrderContext<'_>) -> Self {
        let shares: Vec<(String, f64, f64, f64)> = match assets {
            None => vec![(String::new(), advice.allocation, advice.holding, advice.trade)],
            Some(assets) => {
                let fund = FundAdvice::new(advice, assets);
                let holdings = &assets.fund.holdings;
                let present = assets.names.iter().zip(holdings);
                let present =
                    present.map(|(name, held)| (name.clone(), fund.allocation[name], *held, fund.trade[name]));
                let leaving = assets.leaving.iter().map(|(name, held)| (name.clone(), 0.0, *held, -held));
                present.chain(leaving).collect()
            }
        };
        let left = context.wealth - advice.spending.map_or(0.0, |spending| spending.amount);
        let turnover: f64 = shares.iter().map(|(.., trade)| trade.abs()).sum();
        let all = left * (1.0 - context.trading_cost * turnover);
        let order = |(name, share, holding, trade): (String, f64, f64, f64)| {
            let amount = share * all;
            let traded = amount - holding * context.wealth;
            let is_small = trade.abs() < LITTLE.max(context.smallest.share) || traded.abs() < context.smallest.amount;
            AssetOrder { name, share, holding, trade, amount, traded: if is_small { 0.0 } else { traded } }
        };
        AdviceOrders {
            assets: shares.into_iter().map(order).collect(),
            all,
            total: advice.allocation,
            is_several: assets.is_some(),
            spending: advice.spending,
            contribution: advice.contribution,
        }
    }

    /// Returns the money bought and sold in all.
    fn sums(&self) -> (f64, f64) {
        let sum = |sign: f64| self.assets.iter().map(|order| (sign * order.traded).max(0.0)).sum();
        (sum(1.0), sum(-1.0))
    }

    /// Says the trades in one line; `Nothing` if there are none.
    pub fn trades(&self, money: &MoneyFormat) -> String {
        let (bought, sold) = self.sums();
        match (bought > 0.0, sold > 0.0) {
            (false, false) => "Nothing".to_owned(),
            (true, false) => format!("Buy {}", money.amount(bought)),
            (false, true) => format!("Sell {}", money.amount(sold)),
            (true, true) => format!("Buy {} and sell {}", money.amount(bought), money.amount(sold)),
        }
    }

    /// Says what to hold and what to trade.
    pub fn in_words(&self, context: &OrderContext<'_>) -> LetterOrder {
        let of_rest = if self.spending.is_some() { " of the rest" } else { "" };
        let risky = if self.is_several { "the assets" } else { "stocks" };
        let (held, bank) = (figures::share(self.total), figures::share(1.0 - self.total));
        let order = vec![plain("Hold "), strong(held), plain(format!("{of_rest} in {risky}, and {bank} in the bank."))];
        let mut sentences: Vec<Vec<Phrase>> = Vec::new();
        if let Some(SpendingAdvice { share, amount, .. }) = self.spending {
            let amount = context.money.amount(amount);
            let before = format!(" ({} of wealth) before this period.", percent(share, 2));
            sentences.push(vec![strong(format!("Spend {amount}")), plain(before)]);
        }
        match self.is_several {
            true => sentences.push(vec![strong(self.sum_words(context))]),
            false => sentences.extend(self.assets.iter().flat_map(|one| self.one_asset(one, context))),
        }
        if self.contribution != 0.0 {
            let amount = context.money.amount(self.contribution.abs());
            let moves = if self.contribution > 0.0 { "added" } else { "withdrawn" };
            sentences.push(vec![plain(format!("At the end of the period {amount} is {moves}."))]);
        }
        let assets = if self.is_several { self.lines(context.money) } else { Vec::new() };
        LetterOrder { title: format!("What to hold in {}", context.period), order, assets, sentences }
    }

    /// Says the trade of one asset, and where it leads.
    fn one_asset(&self, order: &AssetOrder, context: &OrderContext<'_>) -> Vec<Vec<Phrase>> {
        let money = context.money;
        let (now, holding) = (money.amount(order.holding * context.wealth), figures::share(order.holding));
        if order.traded == 0.0 {
            let held = format!(": you hold {now} in stocks now, {holding}.");
            return vec![vec![strong("Nothing to trade"), plain(held)]];
        }
        let part = percent(order.traded.abs() / context.wealth, 1);
        let held = format!(" of stocks, {part} of your wealth: you hold {now} now, {holding}.");
        let [amount, all, bank] = [order.amount, self.all, self.all - order.amount].map(|value| money.amount(value));
        let aim = format!("That makes {amount} of {all} in stocks, and {bank} in the bank.");
        vec![vec![strong(trade_words(order.traded, money)), plain(held)], vec![plain(aim)]]
    }

    fn sum_words(&self, context: &OrderContext<'_>) -> String {
        match self.sums() {
            (0.0, 0.0) => "Nothing to trade.".to_owned(),
            (bought, sold) => {
                let part = percent((bought + sold) / context.wealth, 1);
                format!("{} in all, {part} of your wealth.", self.trades(context.money))
            }
        }
    }

    /// Returns the lines of the assets that are held or traded, the largest first.
    fn lines(&self, money: &MoneyFormat) -> Vec<AssetLine> {
        let size = |order: &AssetOrder| order.share.max(order.holding);
        let mut shown: Vec<&AssetOrder> =
            self.assets.iter().filter(|order| size(order) >= LITTLE || order.trade.abs() >= LITTLE).collect();
        shown.sort_by(|one, other| size(other).total_cmp(&size(one)));
        let line = |order: &AssetOrder| AssetLine {
            name: order.name.clone(),
            share: figures::share(order.share),
            amount: money.amount(order.amount),
            holding: figures::share(order.holding),
            trade: if order.traded == 0.0 { "Nothing".to_owned() } else { trade_words(order.traded, money) },
        };
        shown.into_iter().map(line).collect()
    }
}

fn trade_words(traded: f64, money: &MoneyFormat) -> String {
    format!("{} {}", if traded > 0.0 { "Buy" } else { "Sell" }, money.amount(traded.abs()))
}

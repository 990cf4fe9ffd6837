// The two ways in which a reading of numbers stops short of one answer.

/** What the text is cannot be told from it: `choices` are `{words, said}`, and each `said` settles it. */
export class Question extends Error {
  constructor(asks, question, choices) {
    super(question);
    Object.assign(this, { outcome: "question", asks, choices });
  }
}

/** The text cannot be read; `place` is the cell at fault, `{line, column, start, text}`, where there is one. */
export class Refusal extends Error {
  constructor(message, place = null) {
    super(message);
    Object.assign(this, { outcome: "refused", place });
  }
}

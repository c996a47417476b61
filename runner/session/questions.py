"""Questions to the participant, among them the study's own, and the study's own pages."""

from collections.abc import Iterator
from dataclasses import replace

from protocol.journal.events import QuestionAnswered
from protocol.journal.records import QuestionAnswer
from protocol.journal.state import SessionState
from protocol.plan.trials import Trial
from protocol.study.participant_texts import language, page_key
from protocol.study.study_question import Answer, StudyQuestion, When
from runner.screens import Ask, Instruction, Response
from runner.session.operator_view import update_view
from runner.session.session import Session, SessionContext
from runner.session.waiting import response

Due = tuple[When, int | None, StudyQuestion]
"""When a question is asked, and after which block if it is asked after one."""


def asked(context: SessionContext, screen: Ask) -> tuple[Answer, Response]:
    """Ask a question; return what the answer means, and the response that gave it.

    Raises:
        ValueError: the question does not allow the answer.
    """
    turned = context.session.answer_order == "reversed" and screen.question.values
    shown = replace(screen, question=screen.question.reversed()) if turned else screen
    context.participant.show(shown)
    given = response(context)
    return screen.question.answer(given.answer), given


def asked_after(context: SessionContext, trial: Trial) -> tuple[QuestionAnswer, ...]:
    """Ask the study's own questions about `trial`; return the answers."""
    questions = context.session.study.questions_after(trial.condition)
    return tuple(_asked(context, question) for question in questions)


def ask_due(context: SessionContext) -> None:
    """Ask and record what is due between trials and has not been answered yet."""
    for when, block, question in due(context.session, context.log.state):
        given = _asked(context, question)
        context.log.append(QuestionAnswered(when=when, block=block, **vars(given)))
        context.participant.saved()
        update_view(context)


def read_pages(context: SessionContext, before: str, block: int = 0) -> None:
    """Show the study's own pages before the session, practice or a block, one after another."""
    study = context.session.study
    for number in study.pages(before, block):
        picture = study.page[number].picture
        context.participant.show(Instruction(text=page_key(number), picture=picture))
        response(context)


def introduce(context: SessionContext, trial: Trial, last: Trial | None) -> None:
    """Say that practice begins if `trial` begins it after the trial `last`; show its pages.

    Those before a block likewise.
    """
    if trial.kind == "practice" and (last is None or last.kind != "practice"):
        context.participant.show(Instruction(text="practice"))
        response(context)
        read_pages(context, "practice")
    elif trial.block > 0 and (last is None or last.block != trial.block):
        read_pages(context, "block", trial.block)


def due(session: Session, state: SessionState) -> list[Due]:
    """Return the study's own questions that are due in `state`, in the order of asking."""
    return [
        (when, block, question)
        for when, block in _times(session, state)
        for question in session.study.questions(when, session.number)
        if (question.name, block) not in state.questions
    ]


def _times(session: Session, state: SessionState) -> Iterator[tuple[When, int | None]]:
    trials = session.plan.trials
    left = {trial.block for trial in trials if trial.index not in state.answered}
    yield "before", None
    for block in sorted({trial.block for trial in trials} - left - {0}):
        yield "block", block
    if not left:
        yield "after", None


def _asked(context: SessionContext, question: StudyQuestion) -> QuestionAnswer:
    letters = language(context.session.study, context.session.language).letters
    answer, given = asked(context, Ask(question=question, letters=letters))
    return QuestionAnswer(
        name=question.name,
        answer=answer,
        reaction_time_s=given.reaction_time_s,
        trace=given.trace,
    )

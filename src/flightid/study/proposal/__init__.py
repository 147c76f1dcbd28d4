"""A study file written for data that have none: what is identified, from what, and why so."""

from flightid.study.proposal.proposal import Proposal
from flightid.study.proposal.propose import propose_study

__all__ = ["Proposal", "propose_study"]

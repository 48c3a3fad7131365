"""Synchronous operation across controllers: the telegram with a leading value, its way, and the leading-axis
proxy that receives it (SYN section 3.4).
"""

from motion.s7.proxy.link import LeadingValueLink
from motion.s7.proxy.proxy import LeadingAxisProxy
from motion.s7.proxy.telegram import LeadingTelegram

__all__ = ["LeadingAxisProxy", "LeadingTelegram", "LeadingValueLink"]
